"""Families of faults: how one is drawn, and which reason for stopping is a correct one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from hopping_leg.deploy.drive_link import FaultCode
from hopping_leg.deploy.stop_reasons import Reason
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.server import EmulatorConfig

HOP_SECONDS = 1.0
"""Faults begin at a random time of this long after the first lift-off, s: two to three hops."""


@dataclass(frozen=True)
class Health:
    """A leg of which nothing fails, for ten seconds.

    Attributes:
        robot: Shipped robot that the host is told.
        twin: Seed of the twin of it that hops, with its noise, play, friction and payload; None for
            the robot of the file.
        stands: Whether it stands for most of the time, rather than hop.
        commands: Heights, m, one after the other.
    """

    robot: str
    twin: int | None
    stands: bool
    commands: tuple[float, ...]


@dataclass(frozen=True)
class Mishap:
    """What happens in one trial.

    Attributes:
        faults: Of wire or drives; none where the host itself is struck.
        stall: How long the host stands still, s; 0 if it does not.
        dies: Whether the host is killed.
        start: Differences of the start, where the leg must not be armed at all.
        homed: Whether the drives are told that the leg stands in its start pose.
        at: When, s after the first lift-off.
        health: Where nothing happens.
    """

    faults: tuple[Fault, ...] = ()
    stall: float = 0.0
    dies: bool = False
    start: EmulatorConfig | None = None
    homed: bool = False
    at: float = 0.0
    health: Health | None = None


Draw = Callable[[np.random.Generator], Mishap]
Values = Callable[[np.random.Generator], dict[str, Any]]
"""Draws what makes a fault of a kind: its options."""


@dataclass(frozen=True)
class Family:
    """A kind of mishap.

    Attributes:
        name: As in results.
        draw: Returns one.
        reasons: For which the run may end; ``FINISHED`` where it may go on.
        lies: Whether the leg's true state is asked, and faults begin from arming to sinking.
        refused: Whether the leg must not be armed.
        grounded: Whether it must not hop.
    """

    name: str
    draw: Draw
    reasons: tuple[Reason, ...] = ()
    lies: bool = False
    refused: bool = False
    grounded: bool = False


def _drive(rng: np.random.Generator) -> Literal["hip", "knee", "both"]:
    drive: Literal["hip", "knee", "both"] = rng.choice(["hip", "knee", "both"]).item()
    return drive


def _faulty(kind: str, values: Values = lambda _: {}) -> Draw:
    """Return what draws a fault of a kind at a random time of a random drive."""

    def draw(rng: np.random.Generator) -> Mishap:
        at = float(rng.uniform(0, HOP_SECONDS))
        options = {"drive": _drive(rng), **values(rng)}
        return Mishap((Fault(kind, since="flight", at=at, **options),), at=at)

    return draw


def _few(rng: np.random.Generator) -> dict[str, Any]:
    return {"count": int(rng.integers(1, 6))}


def _between(low: float, high: float) -> Values:
    return lambda rng: {"value": float(rng.uniform(low, high))}


def _one_of(codes: list[int]) -> Values:
    return lambda rng: {"value": float(rng.choice(codes))}


def _either_way(low: float, high: float) -> Values:
    return lambda rng: {"value": float(rng.choice([-1, 1]) * rng.uniform(low, high))}


def _late(rng: np.random.Generator) -> dict[str, Any]:
    return {**_few(rng), "value": float(rng.uniform(0.004, 0.03))}


def _unplugged(rng: np.random.Generator) -> dict[str, Any]:
    return {"drive": "both", "duration": float(rng.uniform(0.05, 0.6))}


def _stall(rng: np.random.Generator) -> Mishap:
    at = float(rng.uniform(0, HOP_SECONDS))
    return Mishap(stall=float(rng.uniform(0.025, 0.3)), at=at)


def _death(rng: np.random.Generator) -> Mishap:
    return Mishap(dies=True, at=float(rng.uniform(0, HOP_SECONDS)))


def _pose(rng: np.random.Generator) -> Mishap:
    """Miscounted turns of a rotor, or a pose in which the leg may not start."""
    if rng.random() < 0.5:
        turns = float(rng.choice([-3, -2, -1, 1, 2, 3]))
        drive = _drive(rng)
        return Mishap(start=EmulatorConfig(faults=(Fault("boot_pose", drive=drive, value=turns),)))
    hip, knee = rng.uniform(2.0, 3.0), rng.uniform(0.3, 2.0)
    return Mishap(start=EmulatorConfig(pose=f"{hip:.3f},{knee:.3f}"))


def _wiring(rng: np.random.Generator) -> Mishap:
    """A wrong sign of a joint, or a wrong gear or belt of the knee, in a pose that looks right.

    The drives were homed while the leg hung straight, or where it stands now.
    """
    hip, knee, homed = rng.uniform(0.5, 1.1), rng.uniform(-2.1, -1.0), bool(rng.random() < 0.5)
    kind = int(rng.integers(3 if homed else 2))
    if kind:
        fault = Fault("reversed", drive=("hip", "knee")[kind - 1])
        hip = hip if homed else -hip
    else:
        ratio = float(rng.choice([0.5, 2 / 3, 1.5, 2.0]))
        fault, knee = Fault("ratio", drive="knee", value=ratio), knee if homed else knee / ratio
    start = EmulatorConfig(faults=(fault,), pose=f"{hip:.3f},{knee:.3f}")
    return Mishap(start=start, homed=homed)


def _nothing(rng: np.random.Generator) -> Mishap:
    robot = str(rng.choice(["legv1", "legv2", "legv2-identified", "legv2-paper"]))
    drawn = robot != "legv1" and rng.random() < 0.8  # twins are those of leg V2
    twin = int(rng.integers(1 << 30)) if drawn else None
    heights = tuple(float(height) for height in rng.uniform(0.22, 0.38, 8))
    return Mishap(health=Health(robot, twin, bool(rng.random() < 0.1), heights))


_SETTINGS = {
    "motor_position.rotor_to_output_ratio": (1.0, 0.1, 1 / 9),
    "servopos.position_min": (-0.01, -0.2, float("nan")),
    "servopos.position_max": (0.01, 0.2, float("nan")),
    "servo.max_current_A": (20.0, 60.0, 150.0),
    "servo.timeout_mode": (0.0, 10.0, 12.0),
    "servo.default_timeout_s": (0.1, 1.0, float("nan")),
}
"""Settings that arming depends on, with wrong values for them."""


def _configuration(rng: np.random.Generator) -> Mishap:
    name = str(rng.choice(list(_SETTINGS)))
    fault = Fault(
        "configuration",
        drive=_drive(rng),
        name=name,
        value=float(rng.choice(_SETTINGS[name])),
    )
    return Mishap(start=EmulatorConfig(faults=(fault,)))


_JUMP, _CODE = _either_way(0.2, 2.0), _one_of([int(code) for code in FaultCode])
_HIGH, _LOW = _between(42.5, 60.0), _between(2.0, 17.5)

_SEVERE: dict[str, Values] = {
    "silence": lambda _: {},
    "power_loss": lambda _: {},
    "encoder_jump": _JUMP,
    "drive_fault": _CODE,
    "over_voltage": _HIGH,
    "under_voltage": _LOW,
}
"""Kinds of fault after which no run may go on."""


def _severe(since: Literal["powered", "flight"], first: float, last: float) -> Draw:
    """Return what draws a severe fault of a drive between two times after an event, s."""

    def draw(rng: np.random.Generator) -> Mishap:
        kind = str(rng.choice(list(_SEVERE)))
        at = float(rng.uniform(first, last))
        options = {"drive": _drive(rng), **_SEVERE[kind](rng)}
        return Mishap((Fault(kind, since=since, at=at, **options),))

    return draw


def _double(rng: np.random.Generator) -> Mishap:
    """Two severe faults within 50 ms of each other."""
    at = float(rng.uniform(0, HOP_SECONDS))
    first, second = (_severe("flight", at, at + 0.05)(rng).faults for _ in range(2))
    return Mishap(first + second, at=at)


LIES = 4.0
"""Lies begin at a random time of this long after power, s: rise, squat, hops, sinking."""

_LIES: dict[str, Values] = {
    "encoder_dead": lambda _: {},
    "sample_frozen": lambda _: {},
    "stale_sample": lambda rng: {"drive": "both", "value": float(rng.choice([0.005, 0.01]))},
    "torque_false": _one_of([0, -1]),
    "velocity_false": lambda rng: {"value": float(rng.choice([0.5, 2.0, -1.0]))},
    "swapped_replies": lambda _: {"drive": "both"},
    "same_id": lambda rng: {"drive": str(rng.choice(["hip", "knee"]))},
    "fast_clock": lambda rng: {"value": float(10 ** rng.uniform(-2, 1) + 1)},
}
"""Kinds of fault in which a drive answers in time, and not the truth."""


def _lying(kind: str, at: float, rng: np.random.Generator) -> Fault:
    return Fault(kind, at=at, **{"drive": _drive(rng), **_LIES[kind](rng)})


def _lie(kind: str) -> Draw:
    """Return what draws a lie of a kind from arming to sinking."""

    def draw(rng: np.random.Generator) -> Mishap:
        return Mishap((_lying(kind, float(rng.uniform(0, LIES)), rng),), at=HOP_SECONDS)

    return draw


def _lie_and_fault(rng: np.random.Generator) -> Mishap:
    """A lie from arming to sinking, and a severe fault within 0.1 s of it."""
    at = float(rng.uniform(0, LIES))
    lie = _lying(str(rng.choice(list(_LIES))), at, rng)
    return Mishap((lie, *_severe("powered", at, at + 0.1)(rng).faults), at=HOP_SECONDS)


_R = Reason
_GLITCH = (_R.FINISHED, _R.REPLIES_MISSING)
_FLIPPED = (
    _R.ENCODER_JUMP, _R.POSITION_LIMIT, _R.SPEED_LIMIT, _R.TORQUE_LIMIT,
    _R.MEASUREMENT_NOT_FINITE, _R.TOO_HOT, _R.VOLTAGE_LOW, _R.VOLTAGE_HIGH, _R.DRIVE_LEFT_MODE,
    _R.DRIVE_FAULT, _R.DRIVE_TIMEOUT, _R.DRIVE_CLOCK, _R.VELOCITY_FALSE, _R.TORQUE_FALSE,
)  # fmt: skip
"""What flipped bits may look like where lines have no checksums."""
_STOPS = (
    _R.REPLIES_MISSING, _R.DRIVE_LEFT_MODE, _R.DRIVE_TIMEOUT, _R.ENCODER_JUMP, _R.DRIVE_FAULT,
    _R.VOLTAGE_HIGH, _R.VOLTAGE_LOW, _R.POSITION_LIMIT,
)  # fmt: skip
"""What severe faults are noticed by."""
_LIED = (
    _R.FINISHED, _R.ENCODER_DEAD, _R.VELOCITY_FALSE, _R.TORQUE_FALSE, _R.SAMPLES_STALE,
    _R.DRIVE_CLOCK, _R.ENCODER_JUMP, _R.ENCODER_DRIFT, _R.POSITION_LIMIT, _R.SPEED_LIMIT,
    _R.STANDS_WRONG, _R.REPLIES_MISSING, _R.DRIVE_TIMEOUT, _R.CONTROLLER_FAILED,
)  # fmt: skip
"""What lies are noticed by; a run may end as planned where one did no harm."""
_HEALTHY = (_R.FINISHED, _R.POSITION_LIMIT, _R.SPEED_LIMIT, _R.TORQUE_LIMIT, _R.STANDS_WRONG)
"""What ends a run of a leg whose controller does not cope with it; its drives do not lie."""
_MISWIRED = (_R.STANDS_WRONG, _R.POSITION_LIMIT, _R.SPEED_LIMIT)
_DRIFT = (_R.ENCODER_DRIFT, _R.VELOCITY_FALSE, _R.ENCODER_JUMP, _R.POSITION_LIMIT)

FAMILIES = {
    family.name: family
    for family in (
        Family("dropped reply", _faulty("drop_reply", _few), _GLITCH),
        Family("corrupted reply", _faulty("corrupt_reply", _few), (*_GLITCH, *_FLIPPED)),
        Family("late reply", _faulty("late_reply", _late), _GLITCH),
        Family("duplicated reply", _faulty("duplicate_reply", _few), (_R.FINISHED,)),
        Family("total loss", _faulty("silence"), (_R.REPLIES_MISSING,)),
        Family("garbage line", _faulty("garbage_line", _few), (_R.FINISHED,)),
        Family("encoder jump", _faulty("encoder_jump", _JUMP), (_R.ENCODER_JUMP,)),
        Family("encoder drift", _faulty("encoder_drift", _either_way(0.4, 2.0)), _DRIFT),
        Family("drive fault", _faulty("drive_fault", _CODE), (_R.DRIVE_FAULT,)),
        Family(
            "over-temperature",
            _faulty("over_temperature", _between(100.0, 2000.0)),
            (_R.TOO_HOT, _R.DRIVE_FAULT),
        ),
        Family("over-voltage", _faulty("over_voltage", _HIGH), (_R.VOLTAGE_HIGH, _R.DRIVE_FAULT)),
        Family("under-voltage", _faulty("under_voltage", _LOW), (_R.VOLTAGE_LOW, _R.DRIVE_FAULT)),
        Family("limit notice", _faulty("limit_notice", _one_of([*range(96, 106)])), (_R.FINISHED,)),
        Family(
            "adapter unplugged",
            _faulty("unplug", _unplugged),
            (_R.REPLIES_MISSING, _R.DRIVE_TIMEOUT),
        ),
        Family("drive restarted", _faulty("power_loss"), (_R.DRIVE_LEFT_MODE, _R.REPLIES_MISSING)),
        Family("fault while arming", _severe("powered", 0.0, 0.3), _STOPS),
        Family("fault at lift-off", _severe("flight", 0.0, 0.005), _STOPS),
        Family("fault while sinking", _severe("flight", 1.0, 1.6), _STOPS),
        Family("double fault", _double, _STOPS),
        Family("dead encoder", _lie("encoder_dead"), _LIED, lies=True),
        Family("frozen sample", _lie("sample_frozen"), _LIED, lies=True),
        Family("stale samples", _lie("stale_sample"), _LIED, lies=True),
        Family("false torque", _lie("torque_false"), _LIED, lies=True),
        Family("false velocity", _lie("velocity_false"), _LIED, lies=True),
        Family("swapped replies", _lie("swapped_replies"), _LIED, lies=True),
        Family("one id for two", _lie("same_id"), _LIED, lies=True),
        Family("fast clock", _lie("fast_clock"), _LIED, lies=True),
        Family("lie and fault", _lie_and_fault, (*_LIED, *_STOPS), lies=True),
        Family("no fault", _nothing, _HEALTHY),
        Family("stalled host", _stall, (_R.LOOP_STALLED, _R.DRIVE_TIMEOUT)),
        Family("killed host", _death),
        Family("wrong boot pose", _pose, refused=True),
        Family("wrong wiring", _wiring, _MISWIRED, grounded=True),
        Family("wrong configuration", _configuration, refused=True),
    )
}
"""Every family, by name."""
