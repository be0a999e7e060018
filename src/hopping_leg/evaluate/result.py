"""The numbers of an evaluation, as typed records and as JSON."""

from dataclasses import asdict, dataclass, field
from typing import Any

from hopping_leg.evaluate.motor_load import MotorLoad
from hopping_leg.io import plain

SCHEMA = 2
"""Version of the JSON, raised when a name changes its meaning."""


@dataclass(frozen=True, kw_only=True)
class HopStatistics:
    """One controller at one command, hops of all its runs pooled; 95 % intervals resample runs."""

    controller: str
    robot: str
    command_m: float
    median_error_m: float
    """Median of apex minus command, misses included."""
    median_error_low_m: float
    median_error_high_m: float
    median_abs_error_m: float
    """Median of |apex - command|, misses included."""
    mean_abs_error_m: float
    """Mean of |apex - command|, misses included."""
    mean_abs_error_low_m: float
    mean_abs_error_high_m: float
    std_m: float
    """Hop-to-hop standard deviation of the apex."""
    std_low_m: float
    std_high_m: float
    iqr_m: float
    """Interquartile range of the apex."""
    hops: int
    """In-flight apexes counted."""
    skipped_hops: int
    stance_bounces: int
    hop_rate_hz: float
    flight_fraction: float
    min_base_height_m: float
    max_sink_m: float
    body_contacts: int
    """Times base or knee touched the ground."""
    base_contacts: int
    knee_contacts: int
    peak_hip_torque_nm: float
    peak_knee_torque_nm: float
    measured_s: float
    """Time in which hops were counted."""
    runs: int
    missed_runs: int
    """Runs without a hop: their errors are misses, standing height minus command."""


@dataclass(frozen=True, kw_only=True)
class Summary(MotorLoad, HopStatistics):
    """How one controller hops at one command, and what that is for the motors."""


@dataclass(frozen=True)
class Staircase:
    """The 30 s trial of one controller."""

    controller: str
    commands_m: list[float]
    median_apexes_m: list[float]
    monotone: bool
    """Medians over all seeds rise at every step."""
    monotone_runs: int
    """Runs whose own medians rise at every step."""
    runs: int
    skipped_hops: int
    """Over the whole 30 s after the start, all runs."""


@dataclass(frozen=True)
class Estimator:
    """Estimated minus true height of a controller that estimates it, all runs pooled."""

    controller: str
    flight_bias_m: float
    """Mean over ticks in flight."""
    flight_std_m: float
    stance_bias_m: float
    stance_std_m: float
    apex_bias_m: float
    """Mean over hops of the apex estimated after landing minus the true one."""
    apex_std_m: float
    hops: int
    """Hops that the controller noticed."""


@dataclass(frozen=True)
class Group:
    """Several policies of one recipe, trained with different seeds, at one command."""

    group: str
    command_m: float
    policies: int
    motionless: int
    """Policies that never hopped; their errors are misses, standing height minus command."""
    median_error_m: float
    """Median over policies of each policy's median error."""
    median_error_low_m: float
    """Lower end of its 95 % bootstrap interval, policies resampled."""
    median_error_high_m: float
    worst_abs_error_m: float
    median_std_m: float
    skipped_hops: int
    body_contacts: int


@dataclass(frozen=True)
class Evaluation:
    """Everything measured, without the traces."""

    summary: list[Summary]
    """One row per controller and command: fixed trials and the sequence pooled."""
    sequence: list[Summary]
    """The sequence alone."""
    ladder: list[Summary]
    staircase: list[Staircase]
    neighbours: list[dict[str, Any]]
    """Neighbouring commands compared: controller, neighbours."""
    distributions: list[dict[str, Any]]
    """Apexes behind ``summary``: controller, command_m, apexes_m."""
    estimators: list[Estimator] = field(default_factory=list)
    groups: list[Group] = field(default_factory=list)
    conditions: dict[str, Any] = field(default_factory=dict)
    """Robot, digest, floor, disturbance, seeds, steps, rates."""
    versions: dict[str, str] = field(default_factory=dict)
    """Versions of the software."""
    notes: list[str] = field(default_factory=list)
    """What was left out and why."""
    command: str = ""
    """What makes this evaluation again."""
    secondary: "Evaluation | None" = None
    """The same on another floor, if that was asked for."""

    @property
    def controllers(self) -> list[str]:
        """Names in the order of the rows."""
        return list(dict.fromkeys(row.controller for row in self.summary))

    def rows(self, controller: str) -> list[Summary]:
        """Return a controller's rows of the summary, by rising command."""
        return [row for row in self.summary if row.controller == controller]

    def to_json(self) -> dict[str, Any]:
        """Return plain values; numbers that do not exist are None."""
        return {"schema": SCHEMA, **plain(asdict(self))}
