"""What hopping asks of the motors, of their drives, of the bus that feeds them and of the ground.

Windings lose P = 3/2 R (tau / (N k_t))^2, with tau at the joint, N the gear's and belt's ratio, k_t
and R the rotor's torque constant and the resistance of a phase: moteus' own formula for its power.

Heat is one lump. A drive's temperature nears ambient + (T_derate - ambient) (tau_rms / tau_rated)^2
with one time constant T, as the rated torque is by definition the one that may be held for ever; it
is there after -T ln(1 - (tau_rated / tau_rms)^2), or never. Then (a moteus at 50 deg C) the drive
takes torque away, and at its fault temperature (75 deg C) the rest.

Braking gives power back. On a bus that takes none, its capacitance C is charged from V_0 by a burst
of the energy E to sqrt(V_0^2 + 2 E / C).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.robot import GRAVITY, JOINTS, Robot
from hopping_leg.sim import LOADS
from hopping_leg.trace import Trace

REVERSAL = 4.0  # Change of a joint's commanded torque within a tick that counts as a reversal, N m


@dataclass(frozen=True, kw_only=True)
class MotorLoad:
    """Load over whole runs, their start included; NaN where the simulation does not tell it."""

    outside_limits_fraction: float
    """Share of time in which a joint's true angle is outside its soft limits."""
    soft_limit_share: float
    """Share of their PD's RMS, of both joints, in the sum of it and the controller's own."""
    rms_hip_torque_nm: float
    """At the joint, over physics steps."""
    rms_knee_torque_nm: float
    hip_heat_w: float
    """Mean loss of the windings."""
    knee_heat_w: float
    rated_torque_share: float
    """RMS torque over the motor's rated one, of the motor that has more of it."""
    thermal_minutes: float
    """Time from cold until a drive takes torque away; infinite if it never does."""
    peak_knee_speed_rad_s: float
    torque_reversals_hz: float
    """Changes of sign of the commanded torque by more than ``REVERSAL``, both joints together."""
    mean_power_w: float
    """Mechanical: mean of what each motor puts in, none counted in the ticks in which it brakes."""
    mean_electrical_power_w: float
    """From the bus: mechanical power, less what braking gives back, and the windings' loss."""
    peak_regeneration_w: float
    """Largest mechanical power that both motors together take out at one physics step."""
    bus_voltage_rise_v: float
    """Of the worst burst of braking, less the windings' loss, on a bus that takes none of it."""
    peak_ground_force_weights: float
    """Highest vertical force of the ground in a run over the leg's weight, median over runs."""
    stop_contacts: int | None
    """Times a joint touched a mechanical stop; None where the simulation does not tell it."""


UNKNOWN = MotorLoad(**dict.fromkeys(MotorLoad.__dataclass_fields__, np.nan))  # type: ignore[arg-type]
"""The load of a leg that nothing is known of."""


def motor_load(parts: Sequence[Trace], robot: Robot) -> MotorLoad:
    """Measure some stretches of runs together, each in one piece."""
    ends = np.cumsum([len(part.table) for part in parts])
    period = float(np.diff(parts[0].column("time_s")).mean())
    angle, command, soft = (
        _columns(parts, [f"{joint}_{name}" for joint in JOINTS])
        for name in ("position_rad", "command_nm", "soft_limit_nm")
    )
    loads = dict(zip(LOADS, _columns(parts, LOADS).T, strict=True))
    square = np.stack([loads[f"{joint}_mean_square_torque"] for joint in JOINTS], axis=1)
    power = np.stack([loads[f"{joint}_power"] for joint in JOINTS], axis=1)
    joints, servos = (robot.hip, robot.knee), robot.hardware.servos
    gain = robot.of_joints("belt_ratio") * [j.motor.gear_ratio for j in joints]
    gain *= [servo.torque_constant for servo in servos]
    loss = 1.5 * np.array([servo.winding_resistance for servo in servos]) / gain**2
    heat = (loss * square).mean(axis=0)
    bus = (power + loss * square).sum(axis=1)
    rms, added, own = np.sqrt(square.mean(axis=0)), _rms(soft), _rms(command)
    share = rms / [joint.motor.rated_torque * joint.belt_ratio for joint in joints]
    outside = (angle < robot.of_joints("lower")) | (angle > robot.of_joints("upper"))
    stops = np.split(loads["stop_contact"], ends[:-1])
    forces = [force.max() for force in np.split(loads["ground_force"], ends[:-1])]
    stored = max(_stored(-b * period) for b in np.split(bus, ends[:-1]))
    start, capacitance = robot.hardware.bus_voltage, robot.hardware.bus_capacitance
    return MotorLoad(
        outside_limits_fraction=float(outside.any(axis=1).mean()),
        soft_limit_share=added / (added + own) if added + own else 0.0,
        rms_hip_torque_nm=float(rms[0]),
        rms_knee_torque_nm=float(rms[1]),
        hip_heat_w=float(heat[0]),
        knee_heat_w=float(heat[1]),
        rated_torque_share=float(share.max()),
        thermal_minutes=min(map(_minutes, share, [s.thermal_time_constant for s in servos])),
        peak_knee_speed_rad_s=float(loads["knee_peak_speed"].max()),
        torque_reversals_hz=sum(map(_reversals, np.split(command, ends[:-1]))) / period / ends[-1],
        mean_power_w=float(np.maximum(power, 0).sum(axis=1).mean()),
        mean_electrical_power_w=float(bus.mean()),
        peak_regeneration_w=float(np.maximum(-loads["least_power"], 0).max()),
        bus_voltage_rise_v=float(np.sqrt(start**2 + 2 * stored / capacitance) - start),
        peak_ground_force_weights=float(np.median(forces)) / (robot.mass * GRAVITY),
        stop_contacts=None if np.isnan(rms).any() else sum(events(touch > 0) for touch in stops),
    )


def events(happens: BoolArray) -> int:
    """Count the beginnings of something; what lasts counts once."""
    return int((happens[1:] & ~happens[:-1]).sum()) + int(happens[:1].sum())


def _columns(parts: Sequence[Trace], names: Sequence[str]) -> Array:
    """Return columns, (ticks, names); those that a trace lacks, as of hardware, are NaN."""
    tables = [
        [p.column(n) if n in p.table.columns else np.full(len(p.table), np.nan) for n in names]
        for p in parts
    ]
    return np.concatenate(tables, axis=1).T


def _rms(values: Array) -> float:
    return float(np.sqrt(np.square(values).sum(axis=1).mean()))


def _minutes(share: float, time_constant: float) -> float:
    if share > 1:
        return float(-time_constant * np.log(1 - share**-2)) / 60
    return np.inf if share <= 1 else np.nan


def _reversals(command: Array) -> int:
    before, after = command[:-1], command[1:]
    return int(((before * after < 0) & (np.abs(after - before) > REVERSAL)).sum())


def _stored(given: Array) -> float:
    """Return the most that the bus holds, J, given what it gets in each tick, (ticks,)."""
    total = np.cumsum(given)
    return float((total - np.minimum.accumulate(np.minimum(total, 0))).max())
