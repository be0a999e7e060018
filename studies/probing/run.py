"""Probe policies: every target, from the observation and from every hidden layer."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from hopping_leg.cli.options import at_least
from hopping_leg.controllers import RolloutConfig
from hopping_leg.controllers.policy import Policy
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.evaluate.runner import software_versions
from hopping_leg.figure_style import COLOURS, WIDTH, styled
from hopping_leg.robot import load_robot
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


@dataclass(frozen=True)
class Probe:
    """Read contact, phase and height off policies' hidden layers by a linear map."""

    policies: tyro.conf.Positional[tuple[str, ...]] = ("fast", "paper")
    """Shipped names or .onnx files."""
    robot: str = "legv2-paper"
    """A shipped name or the path of a .toml file."""
    study: Annotated[Study, tyro.conf.arg(name="")] = field(default_factory=Study)
    threads: int = 0
    """Threads of the physics, 0 for all cores; results do not depend on it."""
    figure: Path | None = None
    """Draw the scores into this file (.svg)."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        from hopping_leg.controllers import RolloutConfig
        from hopping_leg.controllers.registry import load_policy
        from hopping_leg.figure_style import to_svg
        from hopping_leg.io import write_atomically
        from hopping_leg.rl.onnx_export import expose_hidden

        at_least(0, threads=self.threads, seed=self.study.seed)
        robot = load_robot(self.robot)
        policies = [load_policy(name) for name in self.policies]
        if len({policy.name for policy in policies}) < len(policies) or not policies:
            raise UsageError("Name one policy or more, each of another name.")
        for policy in policies:
            policy.check_robot(robot, other="warn")
        rates = {policy.card.rate for policy in policies}
        if len(rates) > 1:
            raise UsageError("The policies run at different control rates; probe them one by one.")
        setup = RolloutConfig(robot, threads=self.threads, rate=rates.pop())
        with Progress(transient=True) as bar:
            tasks = {policy.name: bar.add_task(policy.name, total=1.0) for policy in policies}
            result = run_study(
                policies,
                expose_hidden,
                setup,
                self.study,
                lambda name, share: bar.update(tasks[name], completed=share),
            )
        _print(result)
        if self.figure:
            write_atomically(self.figure, to_svg(draw_probe(result)))
        return result


def _print(result: dict[str, Any]) -> None:
    """Print a table per policy: a row per set of features, a column per target."""
    for name in result["policies"]:
        own = [row for row in result["rows"] if row["controller"] == name]
        table = Table("from", *dict.fromkeys(row["target"] for row in own), title=name)
        for features in dict.fromkeys(row["features"] for row in own):
            scores = [row["score"] for row in own if row["features"] == features]
            table.add_row(features, *(f"{score:.3f}" for score in scores))
        Console().print(table)


_ACROSS = 2
"""Panels side by side."""


@styled
def draw_probe(result: dict[str, Any]) -> Figure:
    """Draw the scores of all targets, a panel per policy, two side by side.

    Args:
        result: As ``python -m studies.probing`` writes it.
    """
    rows = result["rows"]
    controllers = list(dict.fromkeys(row["controller"] for row in rows))
    targets = list(dict.fromkeys(row["target"] for row in rows))
    across = min(len(controllers), _ACROSS)
    down = math.ceil(len(controllers) / across)
    height = 0.9 + 0.42 * len(targets) * 1.2
    figure = Figure(figsize=(WIDTH, down * height), layout="constrained")
    grid = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
    for unused in grid.flat[len(controllers) :]:
        unused.set_visible(False)
    for panel, controller in zip(grid.flat, controllers, strict=False):
        own = [row for row in rows if row["controller"] == controller]
        features = list(dict.fromkeys(row["features"] for row in own))
        step = 0.8 / len(features)
        for k, name in enumerate(features):
            found = [row for row in own if row["features"] == name]
            places = [targets.index(row["target"]) + (k + 0.5) * step - 0.4 for row in found]
            scores = [max(row["score"], 0.0) for row in found]
            errors = [
                [
                    max(score - max(row["low"], 0.0), 0.0)
                    for row, score in zip(found, scores, strict=True)
                ],
                [max(row["high"] - score, 0.0) for row, score in zip(found, scores, strict=True)],
            ]
            plain = name.partition(",")[0]
            colour = COLOURS[[f.partition(",")[0] for f in features].index(plain) % len(COLOURS)]
            panel.errorbar(
                scores,
                places,
                xerr=errors,
                fmt="o" if plain == name else "x",
                markersize=4,
                linewidth=1,
                color=colour,
                label=name,
            )
        panel.set_title(controller)
        panel.set_xlim(-0.02, 1.02)
        panel.set_xlabel("R² or balanced accuracy on other legs")
        panel.tick_params(labelbottom=True)
        panel.legend(loc="best")
    grid[0, 0].set_yticks(range(len(targets)), targets)
    grid[0, 0].set_ylim(len(targets) - 0.5, -0.5)
    return figure
