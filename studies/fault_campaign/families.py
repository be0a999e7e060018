"""Families of faults: how one is drawn, and which reason for stopping is a correct one."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hopping_leg.deploy.drive_link import FaultCode
from hopping_leg.deploy.stop_reasons import Reason
from hopping_leg.emulator.faults import Fault
from hopping_leg.emulator.server import EmulatorConfig

HOP_SECONDS = 1.0
"""Faults begin at a random time of this long after the first lift-off, s: two to three hops."""


@dataclass(frozen=True)
class Mishap:
    """What happens in one trial.

    Attributes:
        fault: Of wire or drives; None where the host itself is struck.
        second: Another one.
        stall: How long the host stands still, s; 0 if it does not.
        dies: Whether the host is killed.
        start: Differences of the start, where the leg must not be armed at all.
        homed: Whether the drives are told that the leg stands in its start pose.
        at: When, s after the first lift-off.
    """

    fault: Fault | None = None
    second: Fault | None = None
    stall: float = 0.0
    dies: bool = False
    start: EmulatorConfig | None = None
    homed: bool = False
    at: float = 0.0


@dataclass(frozen=True)
class Family:
    """A kind of mishap.

    Attributes:
        name: As in results.
        draw: Returns one.
        reasons: For which the run may end; ``FINISHED`` where it may go on.
        refused: Whether the leg must not be armed.
        grounded: Whether it must not hop.
    """

    name: str
    draw: Callable[[np.random.Generator], Mishap]
    reasons: frozenset[Reason] = field(default=frozenset())
    refused: bool = False
    grounded: bool = False


_READINGS = {
    *(Reason.ENCODER_JUMP, Reason.POSITION_LIMIT, Reason.SPEED_LIMIT, Reason.TORQUE_LIMIT),
    *(Reason.MEASUREMENT_NOT_FINITE, Reason.TOO_HOT, Reason.VOLTAGE_LOW, Reason.VOLTAGE_HIGH),
    *(Reason.DRIVE_LEFT_MODE, Reason.DRIVE_FAULT, Reason.DRIVE_TIMEOUT),
}
"""What flipped bits may look like where lines have no checksums."""

_GLITCH = {Reason.FINISHED, Reason.REPLIES_MISSING}


def _faulty(
    kind: str, options: Callable[[np.random.Generator], dict[str, float | str]]
) -> Callable[[np.random.Generator], Mishap]:
    """Return what draws a fault of a kind at a random time of a random drive."""

    def draw(rng: np.random.Generator) -> Mishap:
        at = float(rng.uniform(0, HOP_SECONDS))
        drive = str(rng.choice(["hip", "knee", "both"]))
        values = {"drive": drive, **options(rng)}
        return Mishap(Fault(kind, since="flight", at=at, **values), at=at)  # type: ignore[arg-type]

    return draw


def _nothing(_: np.random.Generator) -> dict[str, float | str]:
    return {}


def _few(rng: np.random.Generator) -> dict[str, float | str]:
    return {"count": int(rng.integers(1, 6))}


def _between(low: float, high: float) -> Callable[[np.random.Generator], dict[str, float | str]]:
    return lambda rng: {"value": float(rng.uniform(low, high))}


def _one_of(codes: list[int]) -> Callable[[np.random.Generator], dict[str, float | str]]:
    return lambda rng: {"value": float(rng.choice(codes))}


def _late(rng: np.random.Generator) -> dict[str, float | str]:
    return {**_few(rng), "value": float(rng.uniform(0.004, 0.03))}


def _jump(rng: np.random.Generator) -> dict[str, float | str]:
    return {"value": float(rng.choice([-1, 1]) * rng.uniform(0.2, 2.0))}


def _drift(rng: np.random.Generator) -> dict[str, float | str]:
    return {"value": float(rng.choice([-1, 1]) * rng.uniform(0.4, 2.0))}


def _unplugged(rng: np.random.Generator) -> dict[str, float | str]:
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
        drive = str(rng.choice(["hip", "knee", "both"]))
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
        drive=str(rng.choice(["hip", "knee", "both"])),
        name=name,
        value=float(rng.choice(_SETTINGS[name])),
    )
    return Mishap(start=EmulatorConfig(faults=(fault,)))


_SEVERE: dict[str, Callable[[np.random.Generator], dict[str, float | str]]] = {
    "silence": _nothing,
    "power_loss": _nothing,
    "encoder_jump": _jump,
    "drive_fault": _one_of([int(code) for code in FaultCode]),
    "over_voltage": _between(42.5, 60.0),
    "under_voltage": _between(2.0, 17.5),
}
"""Kinds of fault after which no run may go on."""

_SEVERE_REASONS = (
    *(Reason.REPLIES_MISSING, Reason.DRIVE_LEFT_MODE, Reason.DRIVE_TIMEOUT, Reason.ENCODER_JUMP),
    *(Reason.DRIVE_FAULT, Reason.VOLTAGE_HIGH, Reason.VOLTAGE_LOW, Reason.POSITION_LIMIT),
)


def _severe(since: str, first: float, last: float) -> Callable[[np.random.Generator], Mishap]:
    """Return what draws a severe fault of a drive between two times after an event, s."""

    def draw(rng: np.random.Generator) -> Mishap:
        kind = str(rng.choice(list(_SEVERE)))
        at, drive = float(rng.uniform(first, last)), str(rng.choice(["hip", "knee", "both"]))
        values = {"drive": drive, **_SEVERE[kind](rng)}
        return Mishap(Fault(kind, since=since, at=at, **values))  # type: ignore[arg-type]

    return draw


_WITHIN = 0.05  # s


def _double(rng: np.random.Generator) -> Mishap:
    """Two severe faults within some ticks of each other."""
    at = float(rng.uniform(0, HOP_SECONDS))
    first, second = (_severe("flight", at, at + _WITHIN)(rng).fault for _ in range(2))
    return Mishap(first, second, at=at)


def _family(
    name: str, draw: Callable[[np.random.Generator], Mishap], *reasons: Reason
) -> tuple[str, Family]:
    return name, Family(name, draw, frozenset(reasons))


_R = Reason

FAMILIES: dict[str, Family] = dict(
    [
        _family("dropped reply", _faulty("drop_reply", _few), *_GLITCH),
        _family("corrupted reply", _faulty("corrupt_reply", _few), *_GLITCH, *_READINGS),
        _family("late reply", _faulty("late_reply", _late), *_GLITCH),
        _family("duplicated reply", _faulty("duplicate_reply", _few), _R.FINISHED),
        _family("total loss", _faulty("silence", _nothing), _R.REPLIES_MISSING),
        _family("garbage line", _faulty("garbage_line", _few), _R.FINISHED),
        _family("encoder jump", _faulty("encoder_jump", _jump), _R.ENCODER_JUMP),
        _family(
            "encoder drift",
            _faulty("encoder_drift", _drift),
            *(_R.ENCODER_DRIFT, _R.ENCODER_JUMP, _R.POSITION_LIMIT),
        ),
        _family(
            "drive fault",
            _faulty("drive_fault", _one_of([int(code) for code in FaultCode])),
            _R.DRIVE_FAULT,
        ),
        _family(
            "over-temperature",
            _faulty("over_temperature", _between(100.0, 2000.0)),
            *(_R.TOO_HOT, _R.DRIVE_FAULT),
        ),
        _family(
            "over-voltage",
            _faulty("over_voltage", _between(42.5, 60.0)),
            *(_R.VOLTAGE_HIGH, _R.DRIVE_FAULT),
        ),
        _family(
            "under-voltage",
            _faulty("under_voltage", _between(2.0, 17.5)),
            *(_R.VOLTAGE_LOW, _R.DRIVE_FAULT),
        ),
        _family("limit notice", _faulty("limit_notice", _one_of([*range(96, 106)])), _R.FINISHED),
        _family(
            "adapter unplugged",
            _faulty("unplug", _unplugged),
            *(_R.REPLIES_MISSING, _R.DRIVE_TIMEOUT),
        ),
        _family(
            "drive restarted",
            _faulty("power_loss", _nothing),
            *(_R.DRIVE_LEFT_MODE, _R.REPLIES_MISSING),
        ),
        _family("fault while arming", _severe("powered", 0.0, 0.3), *_SEVERE_REASONS),
        _family("fault at lift-off", _severe("flight", 0.0, 0.005), *_SEVERE_REASONS),
        _family("fault while sinking", _severe("flight", 1.0, 1.6), *_SEVERE_REASONS),
        _family("double fault", _double, *_SEVERE_REASONS),
        _family("stalled host", _stall, _R.LOOP_STALLED, _R.DRIVE_TIMEOUT),
        _family("killed host", _death),
        ("wrong boot pose", Family("wrong boot pose", _pose, refused=True)),
        (
            "wrong wiring",
            Family(
                "wrong wiring",
                _wiring,
                frozenset({_R.STANDS_WRONG, _R.POSITION_LIMIT, _R.SPEED_LIMIT}),
                grounded=True,
            ),
        ),
        ("wrong configuration", Family("wrong configuration", _configuration, refused=True)),
    ]
)
"""Every family, by name."""
