"""Kill commands at random moments, let the same command go on, compare with an undisturbed run."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.cli.options import at_least
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.io import write_json
from hopping_leg.progress import ShareProgress

_HOP = "-m hopping_leg.cli"
_PATIENCE = 5.0
"""Time that the processes of a killed command have to end, s."""

_MOST = 20
"""Kills of one run after which it is left alone, so that it comes to an end."""

_TIMES = ("minutes", "seconds", "load_average", "command", "host", "versions")
"""Entries of results that differ from run to run."""


@dataclass(frozen=True)
class Verb:
    """A command that may be killed.

    Attributes:
        name: In results.
        words: Of the command; ``{out}`` is the run's folder, ``{inputs}`` what ``prepare`` made.
        files: That must be the same in the end, below the run's folder.
        prepare: Commands that make the inputs, once.
    """

    name: str
    words: str
    files: tuple[str, ...]
    prepare: tuple[str, ...] = ()


VERBS = {
    verb.name: verb
    for verb in (
        Verb(
            "train",
            f"{_HOP} train --recipe fast --set steps=20000 --heights 0.26 0.30 --resume"
            " --out {out}/run",
            ("run/policy.onnx", "run/result.json"),
        ),
        Verb(
            "identify",
            f"{_HOP} identify {{inputs}}/twin-multisine.parquet --out {{out}}/found.toml"
            " --json {out}/found.json --folder {out}/fit",
            ("found.toml", "found.json"),
            (
                f"{_HOP} excite multisine --robot legv2 --centre 0.7 -1.4 --amplitude 0.3 0.4"
                " --duration 20 --out {inputs}/multisine.parquet",
                f"{_HOP} record {{inputs}}/multisine.parquet --robot twin --believed legv2"
                " --out {inputs}",
            ),
        ),
        Verb(
            "evaluate",
            f"{_HOP} evaluate energy-shaping --no-video --seeds 1 --commands 0.3"
            " --json {out}/found.json",
            ("found.json",),
        ),
        Verb(
            "tune",
            f"{_HOP} tune energy-shaping --generations 3 --population 4 --seconds 2"
            " --out {out}/run --json {out}/found.json",
            ("found.json",),
        ),
        Verb(
            "sim_to_real",
            "-m studies.sim_to_real prediction --twins 1 --methods cad table-1 --repeats 1"
            " --folder {out}/run --json {out}/found.json",
            ("found.json",),
        ),
        Verb(
            "reproduce",
            f"{_HOP} reproduce --quick --out {{out}}/run",
            ("run/transfer.json", "run/evaluation.json"),
        ),
    )
}
"""Every verb by name."""


@dataclass(frozen=True)
class Kills:
    """Which commands are killed, how often."""

    verbs: tuple[str, ...] = tuple(VERBS)
    """Of train, identify, evaluate, tune, sim_to_real, reproduce."""
    kills: int = 30
    """Kills of each, at random moments."""
    seed: int = 0
    """Of the moments."""
    folder: Path = Path("runs/kills")
    """Folder for the runs; verbs that are finished there are not killed again."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Kill, compare, print a line a verb; return every number."""
        at_least(1, kills=self.kills)
        for name in self.verbs:
            if name not in VERBS:
                raise UsageError(unknown_name("verb", name, VERBS))
        rows = [self._row(name, self.folder.absolute() / name) for name in self.verbs]
        return {"kills": self.kills, "seed": self.seed, "rows": rows}

    def _row(self, name: str, folder: Path) -> dict[str, Any]:
        """Return a verb's numbers, kept ones if it is finished with as many kills and this seed."""
        kept, asked = folder / "row.json", {"kills": self.kills, "seed": self.seed}
        if kept.exists():
            row: dict[str, Any] = json.loads(kept.read_text(encoding="utf-8"))
            if row.items() >= asked.items():
                return row
        shutil.rmtree(folder, ignore_errors=True)
        rng = np.random.default_rng([self.seed, list(VERBS).index(name)])
        row = {**kill(VERBS[name], folder, self.kills, rng), **asked}
        print(row, flush=True)
        write_json(kept, row)
        return row


def kill(verb: Verb, folder: Path, kills: int, rng: np.random.Generator) -> dict[str, Any]:
    """Kill a verb so often; return what differed and what was left.

    Args:
        verb: What is killed.
        folder: For its runs.
        kills: How often.
        rng: Source of the moments.
    """
    (folder / "inputs").mkdir(parents=True)
    for words in verb.prepare:
        if not _finish(_start(words, folder, folder / "inputs")):
            raise UsageError(f"`{words}` failed; run it by hand to see why.")
    began = time.monotonic()
    if not _finish(_start(verb.words, folder, folder / "whole")):
        raise UsageError(f"`{verb.words}` failed; run it by hand to see why.")
    whole = time.monotonic() - began
    done = differences = processes = 0
    with ShareProgress() as bar:
        while done < kills:
            out = folder / f"run-{done}"
            for _ in range(min(kills - done, _MOST)):
                running = _start(verb.words, folder, out)
                try:
                    _wait(running, float(rng.uniform(0, whole)))
                except subprocess.TimeoutExpired:
                    processes += _kill(running)
                    done += 1
                    bar.show(verb.name, done / kills)
                else:
                    break
            if not _finish(_start(verb.words, folder, out)):
                differences += 1
            else:
                differences += any(
                    _content(out / file) != _content(folder / "whole" / file) for file in verb.files
                )
    return {
        "verb": verb.name,
        "kills": done,
        "differences": differences,
        "left_processes": processes,
        "left_files": sum(1 for _ in _leftovers(folder)),
        "seconds": whole,
    }


def _start(words: str, folder: Path, out: Path) -> subprocess.Popen[bytes]:
    """Start a command in a session, and with a temporary folder, of its own."""
    (folder / "tmp").mkdir(exist_ok=True)
    out.mkdir(exist_ok=True)
    filled = words.format(out=out, inputs=folder / "inputs").split()
    return subprocess.Popen(
        [sys.executable, *filled],
        env={**os.environ, "TMPDIR": str(folder / "tmp")},
        stdout=subprocess.DEVNULL,
        stderr=(folder / "log.txt").open("ab"),
        start_new_session=True,
    )


def _finish(running: subprocess.Popen[bytes]) -> bool:
    """Return whether a command ends well; a run that is finished already is refused, and is."""
    return _wait(running) in (0, 2)


def _wait(running: subprocess.Popen[bytes], seconds: float | None = None) -> int:
    """Return a command's exit code; who interrupts this study ends the command, too."""
    try:
        return running.wait(seconds)
    except KeyboardInterrupt:
        _kill(running)
        raise


def _kill(running: subprocess.Popen[bytes]) -> int:
    """Kill a command; return how many processes of its session do not end by themselves."""
    running.send_signal(signal.SIGKILL)
    running.wait()
    until = time.monotonic() + _PATIENCE
    while (left := _session(running.pid)) and time.monotonic() < until:
        time.sleep(0.05)
    for process in left:
        os.kill(process, signal.SIGKILL)
    return len(left)


def _session(leader: int) -> list[int]:
    """Return the processes of a session that are alive."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == leader and fields[0] != "Z":
                found.append(int(entry.name))
    return found


def _content(file: Path) -> Any:  # noqa: ANN401
    """Return a file's bytes; of JSON the values that do not depend on when and where it ran."""
    if not file.exists():
        return None
    if file.suffix != ".json":
        return file.read_bytes()
    return _timeless(json.loads(file.read_text(encoding="utf-8")))


def _timeless(tree: Any) -> Any:  # noqa: ANN401
    if isinstance(tree, dict):
        return {key: _timeless(entry) for key, entry in tree.items() if key not in _TIMES}
    return [_timeless(entry) for entry in tree] if isinstance(tree, list) else tree


def _leftovers(folder: Path) -> Iterator[Path]:
    """Yield temporary files: what is left in the temporary folder, and half-written files."""
    yield from (folder / "tmp").iterdir()
    yield from folder.glob("**/*.part")
