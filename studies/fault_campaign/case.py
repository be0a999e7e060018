"""Which trial, what became of it, and how a leg is made to hop in it."""

import dataclasses
import zlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hopping_leg.controllers.command_schedule import CommandSchedule
from hopping_leg.controllers.fallback import with_fallback
from hopping_leg.controllers.protocol import Controller
from hopping_leg.controllers.registry import load_controller
from hopping_leg.deploy.drive_info import home, inspect
from hopping_leg.deploy.hardware_trials import Performance, perform
from hopping_leg.deploy.moteus_link import MoteusLink
from hopping_leg.deploy.motion_sequence import MotionSequence, SequenceTiming, hopping_poses
from hopping_leg.deploy.preflight import check_drives, require_fit
from hopping_leg.deploy.realtime import Clock
from hopping_leg.deploy.safety_limits import hopping_limits
from hopping_leg.deploy.stop_reasons import Reason
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.robot import EmulatedRobot
from hopping_leg.emulator.server import EmulatorConfig, posture
from hopping_leg.robot import SoftLimits, load_robot
from hopping_leg.sim import CONTROL_RATE, SoftLimiter
from hopping_leg.sim.randomization import TWIN_RANGES, Range, draw_twin
from studies.fault_campaign.families import FAMILIES, Mishap
from studies.fault_campaign.verdict import Limits

HEIGHTS = (0.25, 0.30, 0.35)
"""Commanded heights, m; each trial takes one."""

_TIMING = SequenceTiming(hop=0.0, rise=0.3, settle=0.1)
_BEYOND = (
    Range("reality.mass.base", "1", 1.0, 1.2, "payload"),
    Range("hip.friction", "N m", 0.0, 1.0, "dry joint"),
    Range("knee.friction", "N m", 0.0, 1.0, "dry joint"),
)
"""What healthy twins have beyond the others."""
_FIRST_HOP = 0.6
"""Time that the first lift-off may take, s."""
_AFTERWARDS = 0.3
"""Hopping after a mishap that may be survived, s."""


@dataclass(frozen=True)
class Case:
    """Which trial.

    Attributes:
        family: Of the mishap.
        controller: Name or file.
        robot: Name or file.
        index: Number of the repeat.
        seed: Of the campaign.
        live: In real time over a terminal, rather than in virtual time.
    """

    family: str
    controller: str
    robot: str
    index: int
    seed: int
    live: bool = False

    @property
    def rng(self) -> np.random.Generator:
        """The trial's own source of randomness: the same mishaps for all controllers."""
        family = zlib.crc32(self.family.encode())
        return np.random.default_rng([self.seed, family, self.index, self.live])


@dataclass
class Result:
    """What became of a trial.

    Attributes:
        what: The mishap in words.
        began: When it began, s; None if it did not.
        reason: For which the run ended.
        sentence: The reason with what was seen.
        reaction: From the first bad answer to the first safe command, s; None without either.
        braked: From the host's death until the drives brake, s.
        shown: How long a false torque or velocity showed before the stop, s.
        disturbed: Whether the run ended safely, but because the computer was too slow for it: such
            a trial in real time tells nothing.
        problems: What was unsafe or wrong; empty if all is well.
    """

    what: str
    began: float | None = None
    reason: str = ""
    sentence: str = ""
    reaction: float | None = None
    braked: float | None = None
    shown: float | None = None
    disturbed: bool = False
    problems: list[str] = field(default_factory=list)


class Scene:
    """All that is drawn for a trial: of a family, on the robot that the host is told."""

    def __init__(self, case: Case) -> None:
        rng = case.rng
        self.case, self.family = case, FAMILIES[case.family]
        self.mishap = self.family.draw(rng)
        self.start = dataclasses.replace(
            self.mishap.start or EmulatorConfig(faults=self.mishap.faults),
            robot=case.robot,
            seed=int(rng.integers(1 << 30)),
        )
        health = self.mishap.health
        self.robot = load_robot(case.robot if health is None else health.robot)
        self.safety_limits = hopping_limits(self.robot, CONTROL_RATE)
        self.limits = Limits.of(self.robot, self.safety_limits)
        self.height = float(rng.choice(HEIGHTS))
        self.checksums = bool(rng.random() < 0.5)
        self.killed_after = float(rng.uniform(0, 0.01))
        """Time of the computer between the moment of the hop and a kill, s."""

    def emulate(self) -> EmulatedRobot:
        """Return the emulated robot: as it starts, or a healthy one."""
        health = self.mishap.health
        if health is None:
            return self.start.build()
        true = self.robot
        if health.twin is not None:
            true = draw_twin(health.twin, health.robot, (*TWIN_RANGES, *_BEYOND)).robot
        return EmulatedRobot(true, posture(self.robot, "stand"), seed=self.start.seed)

    def _sequence(self, controller: Controller) -> MotionSequence:
        """Return how the leg rises, hops beyond the mishap, and sinks."""
        timing = SequenceTiming() if self.family.grounded else _TIMING
        timing = dataclasses.replace(timing, hop=_FIRST_HOP + self.mishap.at + _AFTERWARDS)
        schedule: tuple[tuple[float, float], ...] = ((self.height, 100.0),)
        checked = self.robot if self.family.grounded or self.family.lies else None
        if health := self.mishap.health:
            hop, settle = (1.0, 6.0) if health.stands else (6.0, 1.0)
            timing, checked = SequenceTiming(hop=hop, settle=settle), self.robot
            schedule = tuple((height, 0.75) for height in health.commands)
        return MotionSequence(
            with_fallback(controller, self.robot),
            CommandSchedule(schedule),
            hopping_poses(self.robot),
            SoftLimiter(self.robot, SoftLimits()),
            timing,
            checked=checked,
        )

    def require_fitness(self, link: MoteusLink) -> None:
        """Check the drives as before arming, homed if the mishap says so.

        Raises:
            HardwareError: They may not be armed.
        """
        if self.mishap.homed:
            home(link, hopping_poses(self.robot).start.tolist())
        require_fit(check_drives(self.robot, self.safety_limits, inspect(link)))

    def perform(self, link: MoteusLink, folder: Path, clock: Clock | None = None) -> Performance:
        """Let the leg rise, hop beyond the mishap, sink and stop; in real time without a clock.

        Raises:
            HardwareError: The drives may not be armed.
            KeyboardInterrupt: A signal stopped the leg.
        """
        sequence = self._sequence(load_controller(self.case.controller, self.robot))
        self.require_fitness(link)
        done = perform(
            link, sequence, self.safety_limits, folder / "run.parquet", clock=clock,
            threaded=self.mishap.dies,
        )  # fmt: skip
        memory = done.outcome.supervisor
        if Reason.OPERATOR_STOP in (memory.cause.reason, memory.stop_cause.reason):
            raise KeyboardInterrupt
        return done


def words(mishap: Mishap) -> str:
    """Return a mishap in words."""
    if mishap.start is not None:
        faults = ", ".join(map(_of_fault, mishap.start.faults))
        homed = ", homed in its start pose" if mishap.homed else ""
        return f"{faults}{homed}" or f"pose {mishap.start.pose}"
    if mishap.faults:
        return f"{' and '.join(map(_of_fault, mishap.faults))} at {mishap.faults[0].at:.3f} s"
    if health := mishap.health:
        twin = "" if health.twin is None else f", twin {health.twin}"
        return f"{health.robot}{twin}{', stands' if health.stands else ''}"
    if mishap.dies:
        return f"killed at {mishap.at:.3f} s"
    return f"stalled for {mishap.stall:.3f} s at {mishap.at:.3f} s"


def _of_fault(fault: Fault) -> str:
    times = f"{fault.count} times" if fault.count > 1 else ""
    parts = (fault.kind, fault.drive, fault.name, f"value {fault.amount:.4g}", times)
    return " ".join(filter(None, parts))
