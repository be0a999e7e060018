"""What can go wrong, and when: a fault is one entry of a small TOML script.

[[fault]]
kind = "late_reply"
since = "flight"    # the first time that the foot leaves the ground
at = 2.0            # seconds after that ...
phase = "stance"    # ... at the next moment of this phase
drive = "knee"
value = 0.012       # what it means depends on the kind: here seconds
duration = 0.1
"""

import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from hopping_leg.deploy.joint_transform import JOINTS
from hopping_leg.emulator.settings import DEFAULTS
from hopping_leg.errors import UsageError, unknown_name
from hopping_leg.io import read_dataclass


@dataclass(frozen=True)
class Kind:
    """A family of faults.

    Attributes:
        text: What happens.
        unit: Of the fault's value; empty if it has none.
        value: Default value.
        duration: Default duration, s; NaN where a number of replies is meant.
    """

    text: str
    unit: str = ""
    value: float = 0.0
    duration: float = math.inf


KINDS = {
    "drop_reply": Kind("replies are lost", duration=math.nan),
    "corrupt_reply": Kind("bits of replies flip on the serial line", duration=math.nan),
    "late_reply": Kind("replies arrive later", "s", 0.012, math.nan),
    "duplicate_reply": Kind("replies arrive twice", duration=math.nan),
    "silence": Kind("no reply arrives any more"),
    "garbage_line": Kind("noise arrives as a line of its own", duration=math.nan),
    "encoder_jump": Kind("a joint's angle is wrong from now on", "rad", 0.5),
    "drive_fault": Kind("a drive goes to fault with this code", "code", 33.0),
    "over_temperature": Kind("a drive warms up", "K/s", 40.0),
    "over_voltage": Kind("the bus voltage rises to", "V", 50.0),
    "under_voltage": Kind("the bus voltage sags to", "V", 10.0),
    "limit_notice": Kind("a drive reports that a limit is at work", "code", 102.0),
    "unplug": Kind("the adapter is pulled out, and back in after the duration", duration=0.5),
    "power_loss": Kind("a drive restarts: stopped, and not homed"),
    "boot_pose": Kind("a drive counts rotor turns wrongly, from the start", "turns", 1.0),
    "configuration": Kind("a drive's setting is wrong, from the start", "as the setting's"),
}
"""Every kind that a script may name."""

SINCE = ("start", "powered", "flight")
"""From when on ``at`` counts: the emulator's start, both drives powered, first lift-off."""

PHASES = ("any", "stance", "flight", "rising", "falling", "touchdown", "apex")
"""Moments of a hop cycle."""

DRIVES = (*JOINTS, "both")


@dataclass(frozen=True)
class Fault:
    """One fault.

    Raises:
        UsageError: A field has no meaning.
    """

    kind: str = field(metadata={"choices": tuple(KINDS)})
    since: str = "powered"
    at: float = 0.0
    """Seconds after ``since``."""
    phase: str = "any"
    """Moment of the hop cycle that is waited for then."""
    drive: str = "both"
    value: float | None = None
    """In the unit of the kind; none takes the kind's default."""
    duration: float | None = None
    """Seconds; none takes the kind's default, which for replies is their number."""
    count: int = 1
    """Replies, where the kind is about replies and no duration is given."""
    name: str = ""
    """Setting that is wrong, for ``configuration``."""

    def __post_init__(self) -> None:
        for name, valid in (
            ("kind", KINDS),
            ("since", SINCE),
            ("phase", PHASES),
            ("drive", DRIVES),
        ):
            if getattr(self, name) not in valid:
                raise UsageError(unknown_name(f"fault {name}", str(getattr(self, name)), valid))
        for name in ("at", "duration"):
            seconds = getattr(self, name)
            if seconds is not None and not seconds >= 0:
                raise UsageError(f"'{name}' of a {self.kind} is {seconds} s but must be 0 or more.")
        if self.count < 1:
            raise UsageError(f"'count' of a {self.kind} is {self.count} but must be 1 or more.")
        if self.kind == "configuration" and self.name not in DEFAULTS:
            raise UsageError(unknown_name("drive setting", self.name, DEFAULTS))

    @property
    def amount(self) -> float:
        """The value or its default."""
        return KINDS[self.kind].value if self.value is None else float(self.value)

    @property
    def lasts(self) -> float:
        """The duration or its default, s; NaN where ``count`` replies are meant."""
        return KINDS[self.kind].duration if self.duration is None else float(self.duration)

    @property
    def joints(self) -> tuple[int, ...]:
        """Drives that it befalls."""
        return (0, 1) if self.drive == "both" else (JOINTS.index(self.drive),)


def load_faults(path: Path) -> tuple[Fault, ...]:
    """Read a script.

    Raises:
        UsageError: The file is missing, no TOML, or says something that has no meaning.
    """
    try:
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise UsageError(f"There is no fault script {path}.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise UsageError(f"{path} is not a readable TOML file: {error}.") from error
    entries = tree.pop("fault", None)
    if tree or not isinstance(entries, list):
        raise UsageError(f"{path} must hold tables [[fault]] and nothing else.")
    return tuple(
        read_dataclass(Fault, entry, f"{path}, fault {n + 1}") for n, entry in enumerate(entries)
    )
