"""When the foot was in the air and how high the base went, read off the joints afterwards.

No sensor tells contact, and a threshold on the contact force needs frictions that nobody knows. A
small network learns it in simulation, on legs drawn from what is known of leg V2: from the joints'
positions, velocities and torques shortly before *and after* a control step. A controller cannot
have the second half, which makes the question easy.

On the ground the leg's length tells the height. In the air a parabola goes through the heights at
lift-off and touchdown, its apex by the time between the two (paper, "Jumping height estimation").
The rail's drag makes true apexes lower; by how much is learnt on the same simulated legs.
"""

import itertools
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn

from hopping_leg.arrays import Array
from hopping_leg.controllers.energy_shaping.equations import flight_time_apex
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.rollout import Rollout
from hopping_leg.hop_detection import find_hops
from hopping_leg.rl import checkpoint, run_folder
from hopping_leg.rl.finetune import simulated, trial_data
from hopping_leg.robot import JOINTS, Robot, kinematics
from hopping_leg.sim.randomization import IDENTIFIABLE_RANGES, TWIN_RANGES, Range, sample

_CHOSEN = "[C]"

DOUBTS = (
    *(spread for spread in IDENTIFIABLE_RANGES if not spread.path.endswith("armature")),
    Range("hip.armature", "kg m2", 2e-5, 3.8e-3, "Table I to the lab's", "logarithmic"),
    Range("knee.armature", "kg m2", 5e-5, 1.5e-2, "Table I to the lab's", "logarithmic"),
    Range("hip.torque_gain", "1", 0.8, 1.05, f"{_CHOSEN} motors and gears that give less"),
    Range("knee.torque_gain", "1", 0.8, 1.05, f"{_CHOSEN} motors and gears that give less"),
    Range("base.mass", "1", 0.95, 1.05, f"{_CHOSEN} cables and screws", bounds="factors"),
)
"""What the legs differ in on which contact is learnt."""

_MIDDLE = np.array([0.6, -1.3, 0.0, 0.0, 0.0, 0.0])
_SPREAD = np.array([0.4, 0.5, 8.0, 12.0, 3.0, 3.0])
"""Scale of positions, velocities and torques: the network's inputs are about 1 in size."""


@dataclass(frozen=True)
class ContactConfig:
    """How contact is learnt."""

    num_envs: int = 192
    """Legs that differ."""
    seconds: float = 12.0
    """Time that each of them hops, s."""
    hold: float = 1.5
    """Time between new commands, s."""
    reach: int = 16
    """Ticks before and after that the network sees."""
    hidden: tuple[int, ...] = (128, 64)
    """Hidden layers of the network."""
    steps: int = 6000
    """Gradient steps."""
    batch_size: int = 1024
    """Ticks per gradient step."""
    learning_rate: float = 2e-3
    """Learning rate at the start; falls along a cosine."""
    seed: int = 5
    """Seed of legs, commands and weights: runs of one policy and robot share what is learnt."""


class ContactEstimator:
    """A network that tells contact; more than zero is in the air."""

    def __init__(self, options: ContactConfig) -> None:
        self._options = options
        sizes = (6 * (2 * options.reach + 1), *options.hidden)
        layers: list[nn.Module] = []
        for size, following in itertools.pairwise(sizes):
            layers += [nn.Linear(size, following), nn.ELU()]
        self._net = nn.Sequential(*layers, nn.Linear(sizes[-1], 1))

    def airborne(self, data: trial_data.TrialData) -> Array:
        """Return how surely the foot was in the air, (ticks, n)."""
        seen = _normalised(data.filled())
        rows = torch.arange(data.ticks)
        with torch.no_grad():
            legs = [self._judge(seen[:, leg], rows) for leg in range(seen.shape[1])]
        return torch.stack(legs, dim=1).double().numpy()

    def learn(self, data: trial_data.TrialData, flying: Array, seed: int) -> None:
        """Learn from legs of which it is known whether the foot was in the air, (ticks, n)."""
        o, rng = self._options, np.random.default_rng(seed)
        noise = rng.standard_normal((*data.q.shape[:2], 6)) * _sensor_noise()
        seen, truth = _normalised(data.filled() + noise), torch.from_numpy(flying).float()
        ticks, count = flying.shape
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            for layer in self._net:
                if isinstance(layer, nn.Linear):
                    layer.reset_parameters()
            optimizer = torch.optim.Adam(self._net.parameters(), o.learning_rate)
            schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, o.steps)
            for _ in range(o.steps):
                tick = torch.randint(ticks, (o.batch_size,))
                leg = torch.randint(count, (o.batch_size,))
                guess = self._judge(seen, tick, leg)
                loss = nn.functional.binary_cross_entropy_with_logits(guess, truth[tick, leg])
                optimizer.zero_grad()
                torch.autograd.backward(loss)
                optimizer.step()
                schedule.step()

    def state(self) -> checkpoint.Tree:
        """Return its weights."""
        return {name: w.numpy().copy() for name, w in self._net.state_dict().items()}

    def restore(self, state: checkpoint.Tree) -> None:
        """Take weights from a ``state``."""
        self._net.load_state_dict({name: torch.from_numpy(w) for name, w in state.items()})

    def _judge(
        self, seen: torch.Tensor, tick: torch.Tensor, leg: torch.Tensor | None = None
    ) -> torch.Tensor:
        reach = self._options.reach
        around = (tick[:, None] + torch.arange(-reach, reach + 1)).clamp(0, len(seen) - 1)
        windows = seen[around] if leg is None else seen[around, leg[:, None]]
        judged: torch.Tensor = self._net(windows.flatten(1))[:, 0]
        return judged


def doubtful_legs(policy: Policy, robot: Robot, o: ContactConfig) -> Rollout:
    """Let a policy hop on legs that each differ from the believed one."""
    rng = np.random.default_rng(o.seed)
    robots = sample(robot, DOUBTS, o.num_envs, rng)
    span = policy.command_range
    steps = rng.uniform(*span, (round(o.seconds / o.hold), o.num_envs))
    return simulated.hop_many(
        policy, robot, robots, np.repeat(steps, round(o.hold * 200), axis=0), o.seed
    )


def prepare(policy: Policy, robot: Robot, options: ContactConfig, folder: Path) -> "ApexEstimator":
    """Learn to estimate heights in simulation, or take it from an earlier run's folder."""
    contact = ContactEstimator(options)
    asked = {
        "policy": policy.digest,
        "robot": robot.digest,
        "options": run_folder.as_stored(asdict(options)),
    }
    found = checkpoint.list_checkpoints(folder)
    for path in found:
        tree = checkpoint.read_checkpoint(path)
        if tree["asked"] == asked:
            contact.restore(tree["contact"])
            return ApexEstimator(robot, contact, tree["drag"])
    run = doubtful_legs(policy, robot, options)
    flying = (run.data["foot_clearance_m"] > 0).astype(np.float64)
    contact.learn(trial_data.TrialData.of(simulated.traces_of(run)), flying, options.seed)
    estimator = ApexEstimator(robot, contact)
    estimator.calibrate(run)
    tree = {"asked": asked, "contact": contact.state(), "drag": estimator.drag}
    checkpoint.write_checkpoint(folder, len(found), tree)
    return estimator


def _normalised(values: Array) -> torch.Tensor:
    return torch.from_numpy((values - _MIDDLE) / _SPREAD).float()


def _sensor_noise() -> Array:
    """Return the standing noise of leg V2's sensors as the twins have it, (6,)."""
    noise = {spread.path: spread.high for spread in TWIN_RANGES}
    kinds = ("position", "velocity", "torque")
    return np.array(
        [noise[f"reality.{joint}.sensor.{kind}_noise"] for kind in kinds for joint in JOINTS]
    )


_SHORTEST = 0.08
"""Shortest flight, s: one of 8 mm."""

_BOUNCE = 0.02
"""Contact shorter than this is a doubt, not a landing, s."""

_NEAR = 0.06
"""Largest distance of an estimated apex from the true one that is taken for the same, s."""


_ROUNDS, _ALIKE = 30, 1e-3
"""Of reweighting, and the deviation below which all points weigh the same, m."""


class ApexEstimator:
    """Estimates a leg's heights; flight time gives ``drag``, m, too much: constant and slope."""

    def __init__(self, robot: Robot, contact: ContactEstimator, drag: Array | None = None) -> None:
        self.robot, self.contact = robot, contact
        self.drag = np.zeros(2) if drag is None else drag

    def __call__(self, data: trial_data.TrialData) -> list[Array]:
        """Return tick and height of every apex of each trial, m, (hops, 2)."""
        air = self.contact.airborne(data)
        height = kinematics.stance_height(self.robot, data.filled()[..., :2])
        return [
            np.array(
                [
                    self._apex(height[:, leg], begin, end, data.period)
                    for begin, end in _flights(air[:, leg], data.period)
                ]
            ).reshape(-1, 2)
            for leg in range(height.shape[1])
        ]

    def calibrate(self, run: Rollout) -> None:
        """Learn the drag from legs of which the truth is known: a witnessed run of many."""
        estimated = self(trial_data.TrialData.of(simulated.traces_of(run)))
        near = round(_NEAR / (run.time[1] - run.time[0]))
        pairs = []
        for leg, found in enumerate(estimated):
            columns = ("height_m", "height_rate_m_s", "foot_clearance_m")
            hops = find_hops(*(run.data[name][:, leg] for name in columns))
            if not len(found) or not len(hops.tick):
                continue
            nearest = np.argmin(np.abs(found[:, 0] - hops.tick[:, None]), axis=1)
            same = np.abs(found[nearest, 0] - hops.tick) <= near
            pairs.append(np.stack([found[nearest, 1], hops.apex], axis=1)[same])
        reckoned, true = np.concatenate(pairs).T
        self.drag = self.drag + _robust_line(reckoned, reckoned - true)

    def _apex(self, height: Array, begin: float, end: float, period: float) -> tuple[float, float]:
        """Return tick and height of a flight's apex; heights of standing on the foot, (ticks,)."""
        ends = np.interp([begin, end], np.arange(len(height)), height)
        raw = float(flight_time_apex(ends[:1], ends[1:], np.array([(end - begin) * period]))[0])
        apex = max(raw - float(self.drag @ [1.0, raw]), float(ends.max()))
        lean, bulge = ends[1] - ends[0], 4 * (apex - ends.mean())
        top = begin + (end - begin) * np.clip(0.5 + lean / (2 * max(bulge, 1e-9)), 0, 1)
        return round(float(top)), apex


def _flights(air: Array, period: float) -> list[tuple[float, float]]:
    """Return the flights of a trial, ticks with fractions."""
    change = np.diff((air > 0).astype(np.int64))
    begins, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    found: list[tuple[float, float]] = []
    for begin in begins:
        end = ends[np.searchsorted(ends, begin) : np.searchsorted(ends, begin) + 1]
        if not len(end):
            break
        flight = (_crossing(air, int(begin)), _crossing(air, int(end[0])))
        if found and flight[0] - found[-1][1] < _BOUNCE / period:
            flight = (found.pop()[0], flight[1])
        found.append(flight)
    return [(b, e) for b, e in found if e - b >= _SHORTEST / period]


def _crossing(air: Array, tick: int) -> float:
    """Return where a line between a tick and the next is zero, ticks."""
    return float(tick + air[tick] / (air[tick] - air[tick + 1]))


def _robust_line(x: Array, y: Array) -> Array:
    """Return constant and slope of the line of least absolute deviations, (2,)."""
    columns, weight = np.stack([np.ones_like(x), x], axis=1), np.ones_like(y)
    for _ in range(_ROUNDS):
        weighted = columns * weight[:, None]
        line = np.linalg.solve(weighted.T @ columns, weighted.T @ y)
        weight = 1 / np.maximum(np.abs(y - columns @ line), _ALIKE)
    return np.asarray(line)
