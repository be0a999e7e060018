"""How to identify a robot from given recordings, decided from what the recordings are."""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hopping_leg.errors import RecordingError, RobotError, UsageError, unknown_name
from hopping_leg.identify import cost, hops, initial_states, recording_format
from hopping_leg.identify.parameters import STIFFNESS, LegHypothesis, ParameterSet, choose
from hopping_leg.identify.recording import Recording
from hopping_leg.robot import COARSE_TIMESTEP, JOINTS, NO_MISMATCH, Robot, load_robot
from hopping_leg.sim.leg_table import stiffest

_TOLERANCE = 0.2  # share by which link lengths may differ between files of one leg


def robot_of(recordings: Sequence[Recording]) -> str:
    """Return the robot of recordings, or raise UsageError if there is none or there are several."""
    names = list(dict.fromkeys(r.metadata.robot for r in recordings))
    if len(names) != 1:
        raise UsageError(
            f"The recordings belong to several robots ({', '.join(names)}); identify one at a time,"
            " or say with --robot where to start if these are the same leg."
        )
    return names[0]


def check_recordings(recordings: Sequence[Recording], robot: Robot) -> None:
    """Raise RecordingError for another leg's recordings, or ones without their rig's commands."""
    for recording in recordings:
        lacking = np.isnan(recording.array("position")).all(axis=0)
        if lacking.any():
            raise RecordingError(
                f"{recording.name} has no positions of the {JOINTS[int(np.argmax(lacking))]};"
                " record both joints, as one moves the other."
            )
        wanted, what = "position_command", "targets of its on-board PD"
        if recording.metadata.onboard == "torque":
            wanted, what = "torque_command", "commanded torques"
        if not recording.has(wanted):
            names = ", ".join(recording_format.PAIRS[wanted])
            remedy = "record them, or correct 'onboard' in its sidecar"
            raise RecordingError(f"{recording.name} has no {what} ({names}); {remedy}.")
        with contextlib.suppress(RobotError):  # filed under a robot that is not here
            own = load_robot(recording.metadata.robot)
            lengths, given = ((r.thigh.length, r.shank.length) for r in (own, robot))
            if not np.allclose(given, lengths, rtol=_TOLERANCE):
                raise RecordingError(
                    f"{recording.name} is of '{own.name}', whose links are {lengths} m long, but"
                    f" those of '{robot.name}' are {given} m: another leg's robot file."
                )


SEARCHES = ("least-squares", "cma", "two-pass")
"""What a plan may search with."""
_JOINT_PARAMETERS = [f"{j}.{name}" for j in JOINTS for name in ("friction", "damping", "armature")]
_RAIL_PARAMETERS = ["rail.friction", "rail.damping"]
_INERTIAS = ["thigh.inertia", "shank.inertia"]
_SOLVER_PARAMETERS = ["contact.time_constant", "contact.damping_ratio"]
"""Table I; inertias and the contact's are fixed in the first pass."""
_BOOM_PARAMETERS = ["contact.friction", "boom.weight", "thigh.inertia"] + [
    f"reality.knee.{name}" for name in ("efficiency", "stiffness", "stiffness_damping", "backlash")
]
_GAINS = {"stiffness": 10.0, "damping": 0.5, "integral": 1.0}
"""Where a search for an unknown gain begins, in the gain's unit at the joint."""
_USUAL, _SOFTEST = 0.3, 0.02
"""Stiffness of a transmission at first, and at least, over the stiffest that can be simulated."""
_OFTEN, _BEYOND = 0.8, 1.5  # share of the time, and factor, that tell a torque limit from a spike
_FASTEST, _REACHED = 0.999, 0.8
"""Quantile that leaves spikes out, and share of it that a motor at least reaches by itself."""


@dataclass(frozen=True)
class FitPlan:
    """All decisions of an identification."""

    start: LegHypothesis
    parameters: ParameterSet
    scoring: cost.Scoring
    window: float
    """Duration that is simulated from one measured state, s."""
    unscored: float
    """Beginning of each window that does not count, s."""
    search: str


def make_plan(
    recordings: Sequence[Recording],
    robot: Robot,
    *,
    parameters: tuple[str, ...] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    search: str | None = None,
) -> FitPlan:
    """Decide how to identify a robot from recordings, on whatever rigs, as far as it is not said.

    Bounds are those that differ from the widest ones; ``two-pass`` is the paper's search. If all
    names of ``parameters`` begin with ``+``, they come on top of what the recordings can tell.
    """
    search = search or "least-squares"
    if search not in SEARCHES:
        raise UsageError(unknown_name("search", search, SEARCHES))
    found = [gain for gain in _GAINS if any(_is_open(r, gain) for r in recordings)]
    gains = [f"drive.{joint}.{gain}" for gain in found for joint in JOINTS]
    rigs = [r.metadata.rig for r in recordings]
    paper = search == "two-pass"
    if paper:  # Table I, and what is asked for besides
        first, second = pass_names(rigs)
        parameters = tuple(dict.fromkeys([*first, *second, *(parameters or gains)]))
    names = list(parameters or ())
    if all(name.startswith("+") for name in names):
        names = [*_names(recordings, gains), *names]
    names = [name.removeprefix("+") for name in names]
    # Of [reality] the transmission of a joint stays of which a number is fitted.
    fitted = [joint for joint in JOINTS if any(f"reality.{joint}." in name for name in names)]
    kept = {joint: getattr(robot.reality.in_training, joint) for joint in fitted}
    bare = replace(robot, reality=replace(NO_MISMATCH, **kept))
    start = LegHypothesis(bare).replace(_start(recordings, gains))
    for joint, name in zip(JOINTS, STIFFNESS, strict=True):
        if (limit := f"drive.{joint}.torque_limit") in names:
            start = start.replace({limit: getattr(robot, joint).torque_limit})
        if name in names and np.isnan(start.get(name)):
            start = start.replace({name: _USUAL * stiffest(robot, joint, COARSE_TIMESTEP)})
    limits = _bounds(recordings, robot) | dict(bounds or {})
    chosen = choose(start, names, bounds=limits)
    for name in bounds or ():
        if name not in chosen.names:
            raise UsageError(unknown_name("fitted parameter", name, chosen.names))
    scoring = cost.Scoring() if paper else _scoring(recordings, gains)
    # On the ground a longer window is rugged: the moment of touchdown decides all that follows.
    window, unscored = (2.0, 0.5) if gains else (4.0, 1.0)
    if any(r.metadata.onboard == "torque" for r in recordings):
        window, unscored = 0.4, 0.0
    if set(rigs) != {"fixed-base"}:
        window, unscored = 0.25, 0.0
    return FitPlan(start, chosen, scoring, window, unscored, search)


def pass_names(rigs: Sequence[recording_format.Rig]) -> tuple[list[str], list[str]]:
    """Return the parameters of the paper's first pass and those that the second one adds.

    Without a moving base among the rigs nothing is known of rail and contact.
    """
    rail = _RAIL_PARAMETERS if "rail" in rigs else []
    solver = [] if set(rigs) == {"fixed-base"} else _SOLVER_PARAMETERS
    return _JOINT_PARAMETERS + rail, _INERTIAS + solver


def _names(recordings: Sequence[Recording], gains: list[str]) -> list[str]:
    """Return what these recordings can tell, and drives' gains nobody knows."""
    first, second = pass_names([r.metadata.rig for r in recordings])
    names = [n for n in first + second if n not in (*_INERTIAS, "hip.armature")]
    names += ["thigh.com", "shank.com", *_INERTIAS, "drive.delay"]
    if {r.metadata.rig for r in recordings} == {"boom"}:  # hops hardly tell where masses are
        hidden = ("com", "inertia", "weight" if hops.timed(recordings) else "")
        return [n for n in [*names, *_BOOM_PARAMETERS] if n.split(".")[-1] not in hidden]
    # What motors gave is known where it was commanded, or measured beside what was asked for.
    commanded = [r.metadata.onboard == "torque" for r in recordings]
    measured = [r.metadata.onboard == "zoh" and r.has("torque") for r in recordings]
    # In the air a loop asks for torque where it meets damping; on the ground weight asks for it.
    grounded = any(r.metadata.rig != "fixed-base" for r in recordings)
    if all(commanded) or (grounded and np.logical_or(commanded, measured).all()):
        names += [f"{joint}.load_friction" for joint in JOINTS]
    if all(measured) and not gains:  # of which torques tell the product with the motor's alone
        names += [f"{joint}.torque_gain" for joint in JOINTS]
    return [*names, *_limits(recordings), *gains]


def _is_open(recording: Recording, gain: str) -> bool:
    """Return whether a recording leaves a gain to the fit; an unnamed integral is none."""
    if recording.metadata.onboard == "torque":
        return False
    stated = getattr(recording.metadata, gain) is not None
    if gain == "integral":
        return stated and not recording.metadata.gains_exact
    return not recording.has(gain) and not (stated and recording.metadata.gains_exact)


def _limits(recordings: Sequence[Recording]) -> list[str]:
    """Return the torque-speed line of joints whose loop asked for far more than was measured."""
    beyond = np.zeros(2, dtype=bool)
    for recording in recordings:
        metadata, torque = recording.metadata, recording.array("torque")
        unknown = None in (metadata.stiffness, metadata.damping)
        if metadata.onboard != "continuous" or unknown or np.isnan(torque).all(axis=0).any():
            continue
        q, qd = initial_states.full_states(recording)
        spring = np.array(metadata.stiffness) * (recording.array("position_command") - q)
        damper = np.array(metadata.damping) * (recording.array("velocity_command") - qd)
        wanted = np.minimum(np.abs(spring), np.abs(spring + damper))
        asked, given = (np.nanquantile(v, _OFTEN, axis=0) for v in (wanted, np.abs(torque)))
        beyond |= asked > _BEYOND * given
    lines = ("peak_torque", "no_load_speed")
    return [f"{j}.motor.{n}" for j, far in zip(JOINTS, beyond, strict=True) if far for n in lines]


def _bounds(recordings: Sequence[Recording], robot: Robot) -> dict[str, tuple[float, float]]:
    """Return bounds that robot files demand, and of what a joint was seen to do.

    Centres of mass lie on links, peak torques above limits, and no-load speeds above what joints
    reached.
    """
    found = {}
    for name, link in (("thigh", robot.thigh), ("shank", robot.shank)):
        whole = (1 - 1e-9) * link.reach
        if link.com < whole:
            found[f"{name}.com"] = (0.25 * link.com, min(4 * link.com, whole))
    speeds = np.abs(np.concatenate([r.array("velocity") for r in recordings]))
    for name, joint, speed in zip(JOINTS, (robot.hip, robot.knee), speeds.T, strict=True):
        motor, seen = joint.motor, speed[np.isfinite(speed)]
        peak = max(motor.torque_limit, motor.rated_torque)
        most = stiffest(robot, name, COARSE_TIMESTEP)
        found[f"reality.{name}.stiffness"] = (_SOFTEST * most, most)
        found[f"{name}.motor.peak_torque"] = (peak, 4 * motor.peak_torque)
        found[f"drive.{name}.torque_limit"] = (0.0, motor.peak_torque * joint.belt_ratio)
        least = _REACHED * joint.belt_ratio * float(np.quantile(seen, _FASTEST)) if len(seen) else 0
        known = motor.no_load_speed
        found[f"{name}.motor.no_load_speed"] = (max(0.25 * known, min(least, known)), 4 * known)
    return found


def _start(recordings: Sequence[Recording], gains: list[str]) -> dict[str, float]:
    """Return where the drives' open numbers begin: as stated, or as usual."""
    values = {}
    for name in gains:
        _, joint, gain = name.split(".")
        stated = (getattr(r.metadata, gain) for r in recordings)
        pair = next((p for p in stated if p is not None), (_GAINS[gain],) * 2)
        values[name] = pair[joint == "knee"]
    if any(r.metadata.onboard == "continuous" and r.has("velocity_command") for r in recordings):
        values["drive.ramp"] = 1.0
    return values


def _scoring(recordings: Sequence[Recording], gains: list[str]) -> cost.Scoring:
    if any(map(hops.by_hops, recordings)):
        rise = 0.02 if hops.timed(recordings) else 0.006
        return cost.Scoring(position=0.03, height=rise, torque=0.5, robust=3.0, unexplained=4.0)
    if all(r.metadata.onboard == "torque" for r in recordings):
        return cost.Scoring(position=0.02, robust=2.0, unexplained=0.4)
    torque = 0.2 if any(r.has("torque") for r in recordings) else None
    if torque is not None and gains:
        # Torques that no model explains must not leave out windows whose positions tell of a limit.
        return cost.Scoring(0.005, torque=0.5, robust=1.0, unexplained=0.4, in_full=("position",))
    rails = [r for r in recordings if r.metadata.rig == "rail"]
    height = 0.002 if any(r.has_column("height_m") for r in rails) else None
    return cost.Scoring(position=0.005, torque=torque, height=height, robust=3.0, unexplained=0.4)
