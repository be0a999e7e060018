"""What is judged, and how names, files and patterns of the command line become that."""

import glob
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hopping_leg.controllers import Controller
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_controller, shipped_policies
from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class Entry:
    """A controller to be judged."""

    label: str
    """Name in all tables."""
    controller: Controller
    group: str | None = None
    """Name shared by policies of one recipe that differ in the training seed."""
    notes: tuple[str, ...] = ()
    """What a reader of the results must know about it."""

    @property
    def command_range(self) -> tuple[float, float] | None:
        """Heights it was made for, m, or None for any."""
        return getattr(self.controller, "command_range", None)

    def reaches(self, heights: Iterable[float]) -> bool:
        """Tell whether it was made for all of some heights, m."""
        low, high = self.command_range or (-math.inf, math.inf)
        return all(low - 1e-9 <= height <= high + 1e-9 for height in heights)


def load_entries(names: Sequence[str], robot: Robot, rate: float) -> list[Entry]:
    """Load every controller that is named.

    Policy files of one recipe that differ in their training seed become a group.

    Args:
        names: Shipped names, ``.onnx`` files, or patterns of such; ``LABEL=FILE`` gives a file
            another name in all tables, and those of ``runs/*/policy.onnx`` go by their folders.
        robot: The leg they shall drive.
        rate: Control rate, Hz.

    Raises:
        PolicyError: A file is unreadable, does not fit, or a pattern matches nothing.
        UsageError: There is no such controller.
    """
    expanded = dict.fromkeys(pair for text in names for pair in _expand(text))
    return _grouped([_load(label, source, robot, rate) for label, source in expanded])


def check_entries(entries: Sequence[Entry], commands: Sequence[float]) -> None:
    """Check that there is something to judge, under names that differ, and what it is asked for.

    Raises:
        UsageError: There is not, or a height, m, is outside of the range of an entry's training.
    """
    labels = [entry.label for entry in entries]
    if not labels:
        raise UsageError("No controller was named; try `hop evaluate energy-shaping`.")
    for entry in entries:
        if labels.count(entry.label) > 1:
            raise UsageError(f"Controller '{entry.label}' was named twice; name each one once.")
        for height in commands:
            if entry.command_range and not entry.reaches([height]):
                low, high = entry.command_range
                raise UsageError(
                    f"'{entry.label}' cannot be asked for {height:g} m: it was trained for"
                    f" {low:g} to {high:g} m; choose --commands within that range."
                )


def _expand(text: str) -> list[tuple[str, str]]:
    """Return the label and source of everything that a text names."""
    if not any(sign in text for sign in "*?["):
        label, _, source = (text, "", text) if Path(text).exists() else text.rpartition("=")
        return [(label or source, source)]
    found = sorted(glob.glob(text, recursive=True))  # noqa: PTH207
    if not found:
        raise PolicyError(f"No policy file matches '{text}'; quote the pattern and check the path.")
    folders = [Path(path).parent.name for path in found]
    alike = len({Path(path).name for path in found}) == 1
    if len(found) > 1 and alike and len(set(folders)) == len(folders):
        return list(zip(folders, found, strict=True))
    return [(path, path) for path in found]


def _load(label: str, source: str, robot: Robot, rate: float) -> Entry:
    controller = load_controller(source, robot, rate=rate, other="accept", simulated=True)
    note = controller.stranger(robot, label) if isinstance(controller, Policy) else None
    return Entry(label, controller, notes=(note,) if note else ())


def _grouped(entries: list[Entry]) -> list[Entry]:
    """Put policy files of one recipe in a group where every one has a training seed of its own."""
    cards = {
        c.label: c.controller.card
        for c in entries
        if isinstance(c.controller, Policy) and c.label not in shipped_policies()
    }
    names: dict[str, str] = {}
    for recipe in {card.recipe for card in cards.values()}:
        seeds = {label: card.seed for label, card in cards.items() if card.recipe == recipe}
        if len(set(seeds.values())) == len(seeds) > 1:
            names |= dict.fromkeys(seeds, f"{recipe}, {len(seeds)} training seeds")
    return [replace(c, group=names.get(c.label)) for c in entries]
