"""Probe policies: every target, from the observation and from every hidden layer."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.evaluate.runner import software_versions
from studies.probing.exposed import OBSERVATION, Recording, record
from studies.probing.fitting import Scored, interval, probe
from studies.probing.targets import TARGETS, Target

SHUFFLED = ", shuffled"
"""Suffix of the layers of a network whose weights have changed places."""

Expose = Callable[[bytes, int | None], bytes]
"""Returns a policy's graph with hidden layers as outputs, shuffled by a seed or not."""


@dataclass(frozen=True)
class Study:
    """How policies are probed."""

    commands: tuple[float, ...] = (0.25, 0.275, 0.30, 0.325, 0.35)
    """Heights that legs hop to, m."""
    legs: int = 4
    """Legs per command that a probe learns from, and as many others that judge it."""
    seconds: float = 10.0
    """Of hopping; the first 2 s do not count."""
    seed: int = 3000
    """Of noise and delay of the legs that are learnt from; the next one is of those that judge."""

    def __post_init__(self) -> None:
        if self.legs < 2 or not self.seconds > START_SECONDS + 1:
            raise UsageError(
                f"{self.legs} legs for {self.seconds:g} s are too few; give 2 legs or more for more"
                f" than {START_SECONDS + 1:g} s."
            )


@dataclass(frozen=True)
class Row:
    """One target read off one set of features of one policy."""

    controller: str
    target: str
    features: str
    """``observation``, ``hidden_0``, ..., or ``hidden_0, shuffled``."""
    size: int
    """Number of features."""
    measure: str
    """``R2`` or ``balanced accuracy``, of which guessing gives one over the number of classes."""
    score: float
    low: float
    """Lower end of the 95 % bootstrap interval, test legs resampled."""
    high: float
    rms: float | None
    """Root mean square error in ``unit``."""
    unit: str
    gain: float
    """Score less that of the observation."""
    gain_low: float
    gain_high: float


def run_study(
    policies: Sequence[Policy],
    expose: Expose,
    setup: RolloutConfig,
    study: Study,
    on_progress: Callable[[str, float], None] = lambda _label, _share: None,
) -> dict[str, Any]:
    """Probe policies.

    Args:
        policies: What is probed.
        expose: See ``learn.hidden``, which needs the extra 'train'.
        setup: The world, with noise and delay.
        study: How.
        on_progress: Called with a policy's name and the share done.

    Raises:
        UsageError: A command is out of a policy's range.
    """
    rows: list[Row] = []
    for policy in policies:
        rows += _probe_policy(policy, expose, setup, study, on_progress)
    return {
        "rows": [asdict(row) for row in rows],
        "conditions": {
            "robot": setup.robot.name,
            "robot_digest": setup.robot.digest,
            "disturbance": asdict(setup.disturbance),
            **asdict(study),
        },
        "policies": {p.name: {"digest": p.digest, "layout": p.card.layout} for p in policies},
        "versions": software_versions(),
    }


def _probe_policy(
    policy: Policy,
    expose: Expose,
    setup: RolloutConfig,
    study: Study,
    on_progress: Callable[[str, float], None],
) -> list[Row]:
    low, high = policy.card.command_low, policy.card.command_high
    outside = [c for c in study.commands if not low <= c <= high]
    if outside:
        raise UsageError(
            f"'{policy.name}' cannot be asked for {outside[0]:g} m: it was trained for {low:g} to"
            f" {high:g} m; choose --commands within that range."
        )
    graphs = {"": expose(policy.content, None), SHUFFLED: expose(policy.content, study.seed)}
    legs = np.repeat(study.commands, study.legs)
    commands = np.tile(legs, (round(study.seconds * setup.rate), 1))
    train, test = (
        record(policy, graphs, setup, commands, seed) for seed in (study.seed, study.seed + 1)
    )
    rows: list[Row] = []
    for number, target in enumerate(TARGETS):
        on_progress(policy.name, (number + 1) / (len(TARGETS) + 1))
        rows += _probe_target(policy.name, target, train, test, study.seed)
    on_progress(policy.name, 1.0)
    return rows


def _probe_target(
    name: str, target: Target, train: Recording, test: Recording, seed: int
) -> list[Row]:
    wanted = target.values(train.truth, train.rate)
    truth = target.values(test.truth, test.rate)
    scored: dict[str, Scored] = {
        features: probe(values, wanted, test.features[features], truth, target.classes)
        for features, values in train.features.items()
    }
    seen = scored[OBSERVATION]
    rows = []
    for features, found in scored.items():
        low, high = interval(found, seed)
        gain_low, gain_high = interval(found, seed, seen)
        rms = found.rms()
        row = Row(
            controller=name,
            target=target.name,
            features=features,
            size=train.features[features].shape[-1],
            measure="balanced accuracy" if target.classes else "R2",
            score=found.score(),
            low=low,
            high=high,
            rms=None if rms is None else target.scale * rms,
            unit=target.unit,
            gain=found.score() - seen.score(),
            gain_low=gain_low,
            gain_high=gain_high,
        )
        rows.append(row)
    return rows
