"""The house stays small: ceilings of files and lines, a little above what is there."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

CEILINGS = {
    "src/hopping_leg/*.py": (12, 1165), "src/hopping_leg/cli/**/*.py": (16, 1870),
    "src/hopping_leg/controllers/**/*.py": (20, 2580), "src/hopping_leg/deploy/**/*.py": (20, 3250),
    "src/hopping_leg/emulator/**/*.py": (14, 1798), "src/hopping_leg/envs/**/*.py": (10, 1415),
    "src/hopping_leg/evaluate/**/*.py": (13, 1965), "src/hopping_leg/formats/**/*.py": (1, 185),
    "src/hopping_leg/identify/**/*.py": (21, 4349), "src/hopping_leg/rl/**/*.py": (19, 2805),
    "src/hopping_leg/robot/**/*.py": (13, 1980), "src/hopping_leg/sim/**/*.py": (11, 2514),
    "src/hopping_leg/viewer/**/*.py": (6, 950), "src/**/*.py": (176, 26785),
    "tests/**/*.py": (136, 14220), "studies/**/*.py": (73, 7690), "docs/**/*.md": (22, 2500),
    "docs/live/*.js": (13, 1490),
}  # fmt: skip
"""Files and lines at most. Who raises one says what users gain by it."""


@pytest.mark.parametrize("pattern", CEILINGS)
def test_no_part_outgrows_its_ceiling(pattern):
    files = [file.read_text(encoding="utf-8") for file in ROOT.glob(pattern)]
    lines = sum(len(text.splitlines()) for text in files)
    most_files, most_lines = CEILINGS[pattern]
    assert 0 < len(files) <= most_files, f"{pattern}: {len(files)} files, at most {most_files}"
    assert lines <= most_lines, f"{pattern}: {lines} lines, at most {most_lines}"


def test_every_room_has_a_ceiling():
    rooms = (d for d in (ROOT / "src/hopping_leg").iterdir() if any(d.rglob("*.py")))
    assert {f"src/hopping_leg/{room.name}/**/*.py" for room in rooms} <= CEILINGS.keys()
