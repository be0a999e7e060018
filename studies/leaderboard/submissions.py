"""Submissions: folders with ``submission.toml`` and a card."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from hopping_leg.controllers import Controller
from hopping_leg.controllers.registry import (
    controller_names,
    load_controller,
    shipped_card,
    shipped_policies,
)
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.evaluate.entries import fingerprint
from hopping_leg.io import json_text, parse_toml, read_dataclass
from hopping_leg.robot import Robot, load_robot
from hopping_leg.sim import CONTROL_RATE

FOLDER = Path(__file__).parent / "submissions"
FILE, CARD = "submission.toml", "card.md"

ROBOT = "legv2-identified"
"""The leg that all controllers believe in unless they say otherwise, and whose twins they meet."""


@dataclass(frozen=True)
class Facts:
    """What ``submission.toml`` says."""

    authors: tuple[str, ...]
    command: str
    """The shell command that made the controller, or where its making is described."""
    controller: str = ""
    """A shipped name, or a file of the folder: a policy (.onnx), gains (.toml), or a Python class,
    ``FILE.py:Class``; by default the shipped controller that is called as the folder."""
    robot: str = ROBOT
    """What the controller is told of the leg: a shipped robot, or a .toml file of the folder."""


@dataclass(frozen=True)
class Submission:
    """A folder, read."""

    folder: Path
    facts: Facts

    @property
    def name(self) -> str:
        """Name on the leaderboard."""
        return self.folder.name

    @property
    def controller_name(self) -> str:
        """Name that ``load_controller`` knows."""
        return self._own(self.facts.controller) if self.facts.controller else self.name

    def robot(self) -> Robot:
        """Return the leg that the controller believes in."""
        return load_robot(self._own(self.facts.robot))

    def load(self) -> Controller:
        """Make the controller.

        Raises:
            HoppingLegError: It cannot be made.
        """
        name = self.controller_name
        return load_controller(name, self.robot(), rate=CONTROL_RATE, other="accept")

    def card(self) -> str:
        """Return the card, Markdown.

        Raises:
            UsageError: There is none.
        """
        path = self.folder / CARD
        if path.is_file():
            return path.read_text(encoding="utf-8")
        if self.controller_name in shipped_policies():
            return shipped_card(self.controller_name)
        raise UsageError(f"{self.folder} has no {CARD}; write what the controller is and knows.")

    def digest(self) -> str:
        """Return a hash of all that is judged: the folder, what is shipped of it, the robot."""
        files = sorted(p for p in self.folder.rglob("*") if p.is_file() and p.suffix != ".pyc")
        contents = {str(p.relative_to(self.folder)): _hash(p.read_bytes()) for p in files}
        rest = {"robot": self.robot().digest, "controller": fingerprint(self.load())}
        return _hash(json_text({**asdict(self.facts), **contents, **rest}).encode())[:16]

    def _own(self, name: str) -> str:
        """Return the path of a file of the folder, other names as they are."""
        own = self.folder / name
        return str(own) if (self.folder / name.partition(":")[0]).is_file() else name


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def read_submission(folder: Path) -> Submission:
    """Read a submission and check what can be checked without a hop.

    Raises:
        HoppingLegError: The folder, its file, card, robot or controller is not as it must be.
    """
    path = folder / FILE
    if not path.is_file():
        raise UsageError(f"{folder} has no {FILE}; see studies/leaderboard/README.md.")
    facts = read_dataclass(Facts, parse_toml(path.read_bytes(), str(path)), str(path))
    submission = Submission(folder, facts)
    if not facts.controller and submission.name not in controller_names():
        raise UsageError(f"{path}: 'controller' is missing; name a file of the folder.")
    submission.card()
    return submission


def find_submissions(names: Sequence[str] = ()) -> list[Submission]:
    """Return submissions by name, or all.

    Raises:
        UsageError: There is no such submission.
        HoppingLegError: One is not as it must be.
    """
    known = sorted(path.parent.name for path in FOLDER.glob(f"*/{FILE}"))
    for name in names:
        if name not in known:
            raise UsageError(unknown_name("submission", name, known))
    return [read_submission(FOLDER / name) for name in names or known]
