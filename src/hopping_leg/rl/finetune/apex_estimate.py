"""How high the base was, reckoned afterwards from the joints (paper, "Jumping height estimation").

On the ground the leg's length tells. In the air a parabola goes through the heights at lift-off and
touchdown, its apex by the time between the two (``height_estimate.flight_time_apex``). The rail's
drag makes true apexes lower than that; by how much is learnt in simulation, on the legs on which
contact was learnt.
"""

from dataclasses import dataclass

import numpy as np

from hopping_leg.arrays import Array, BoolArray
from hopping_leg.controllers.energy_shaping.equations import flight_time_apex
from hopping_leg.controllers.rollout import Rollout
from hopping_leg.hop_detection import find_hops
from hopping_leg.rl.finetune.contact import Contact
from hopping_leg.rl.finetune.lines import robust_line
from hopping_leg.rl.finetune.simulated import traces_of
from hopping_leg.rl.finetune.trial_data import TrialData
from hopping_leg.robot import kinematics
from hopping_leg.robot.parameters import Robot

_SHORTEST = 0.08
"""Of a flight, s: one of 8 mm."""

_BOUNCE = 0.02
"""Contact shorter than this is a doubt, not a landing, s."""

_NEAR = 0.06
"""Largest distance of an estimated apex from the true one that is taken for the same, s."""


@dataclass(frozen=True)
class ApexEstimate:
    """What is reckoned of n outings.

    Attributes:
        height: Of the base, m, (ticks, n).
        rate: Its derivative, m/s, (ticks, n).
        flying: Whether the foot was in the air, (ticks, n).
        apexes: Per outing tick and height of every apex, m, (hops, 2).
    """

    height: Array
    rate: Array
    flying: BoolArray
    apexes: list[Array]


class ApexEstimator:
    """Reckons heights.

    Args:
        robot: The believed leg: its lengths.
        contact: Tells what is flight.
        drag: Constant and slope over height of what flight time overestimates apexes by, m, (2,).
    """

    def __init__(self, robot: Robot, contact: Contact, drag: Array | None = None) -> None:
        self.robot, self.contact = robot, contact
        self.drag = np.zeros(2) if drag is None else drag

    def __call__(self, data: TrialData) -> ApexEstimate:
        """Return the heights of outings."""
        air = self.contact.airborne(data)
        filled = data.filled()
        q, qd = filled[..., 0:2], filled[..., 2:4]
        height = kinematics.stance_height(self.robot, q)
        rate = kinematics.foot_velocity(self.robot, q, qd)[..., 0]
        flying = np.zeros(height.shape, np.bool_)
        apexes = []
        for leg in range(height.shape[1]):
            found = [
                self._fly(height[:, leg], rate[:, leg], flying[:, leg], begin, end, data.period)
                for begin, end in _flights(air[:, leg], data.period)
            ]
            apexes.append(np.array(found).reshape(-1, 2))
        return ApexEstimate(height, rate, flying, apexes)

    def calibrate(self, run: Rollout) -> None:
        """Learn the drag from legs of which the truth is known: a witnessed run of many."""
        estimated = self(TrialData.of(traces_of(run)))
        near = round(_NEAR / (run.time[1] - run.time[0]))
        pairs = []
        for leg, found in enumerate(estimated.apexes):
            columns = ("height_m", "height_rate_m_s", "foot_clearance_m")
            hops = find_hops(*(run.data[name][:, leg] for name in columns))
            if not len(found) or not len(hops.tick):
                continue
            nearest = np.argmin(np.abs(found[:, 0] - hops.tick[:, None]), axis=1)
            same = np.abs(found[nearest, 0] - hops.tick) <= near
            pairs.append(np.stack([found[nearest, 1], hops.apex], axis=1)[same])
        reckoned, true = np.concatenate(pairs).T
        self.drag = self.drag + robust_line(reckoned, reckoned - true)

    def _fly(
        self, height: Array, rate: Array, flying: BoolArray, begin: float, end: float, period: float
    ) -> tuple[float, float]:
        """Write one flight into an outing's arrays; return tick and height of its apex."""
        ticks = np.arange(len(height))
        ends = np.interp([begin, end], ticks, height)
        lasted = np.array([(end - begin) * period])
        raw = float(flight_time_apex(ends[:1], ends[1:], lasted)[0])
        apex = max(raw - float(self.drag @ [1.0, raw]), ends.max())
        inside = slice(int(np.ceil(begin)), int(np.floor(end)) + 1)
        share = (ticks[inside] - begin) / (end - begin)
        bulge, lean = 4 * (apex - ends.mean()), ends[1] - ends[0]
        height[inside] = ends[0] + lean * share + bulge * share * (1 - share)
        rate[inside] = (lean + bulge * (1 - 2 * share)) / lasted[0]
        flying[inside] = True
        top = begin + (end - begin) * np.clip(0.5 + lean / (2 * max(bulge, 1e-9)), 0, 1)
        return round(float(top)), apex


def _flights(air: Array, period: float) -> list[tuple[float, float]]:
    """Return the flights of an outing, ticks with fractions."""
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
