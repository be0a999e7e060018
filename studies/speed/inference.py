"""How long a policy takes from measurement to torque for one leg on one thread."""

from dataclasses import dataclass

import numpy as np
import tyro

from hopping_leg.cli.options import JsonFile, at_least, show_table
from hopping_leg.controllers.policy import Policy, open_session
from hopping_leg.controllers.registry import load_policy, shipped_policies
from hopping_leg.robot import DEFAULT_ROBOT, load_robot
from hopping_leg.sim import SAMPLES, Measurement
from studies.shared import Row, Timed, host, seconds


@dataclass(frozen=True)
class Inference:
    """Time policies on one thread: the network alone, and with its checks and history."""

    policies: tyro.conf.Positional[tuple[str, ...]] = ()
    """Shipped names or .onnx files; all shipped ones by default."""
    calls: int = 5000
    """Timed decisions of each."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, print a table, return every number."""
        at_least(1, calls=self.calls)
        policies = [load_policy(name) for name in self.policies or shipped_policies()]
        rows = [_row(policy, self.calls) for policy in policies]
        columns = ("policy", "network, median us", "99 %", "whole controller, median us", "99 %")
        cells = [[f"{v:.1f}" if isinstance(v, float) else v for v in r.values()] for r in rows]
        show_table(columns, (row[:5] for row in cells))
        slowest = max(row["inference_median_us"] for row in rows)
        return {"inference_median_us": slowest, "rows": rows, "host": host()}


def _row(policy: Policy, calls: int) -> Row:
    policy.set_robot(load_robot(DEFAULT_ROBOT))
    policy.reset(1)
    session = open_session(policy.content, policy.name)
    rng, shape = np.random.default_rng(0), (1, SAMPLES, 2)
    feeds = {
        one.name: rng.standard_normal((1, *one.shape[1:])).astype(np.float32)
        for one in session.get_inputs()
    }
    command = np.full((1, SAMPLES), sum(policy.command_range) / 2)
    age = np.arange(SAMPLES)[None] / policy.card.rate
    seen = Measurement(rng.standard_normal(shape), rng.standard_normal(shape), command, age)
    return {
        "policy": policy.name,
        **_times("inference", lambda: session.run(None, feeds), calls),
        **_times("controller", lambda: policy.act(seen), calls),
        "calls": calls,
    }


def _times(name: str, call: Timed, calls: int) -> Row:
    """Return median and 99th percentile of the duration of a call, us, after some cold ones."""
    taken = [1e6 * seconds(call) for _ in range(calls + calls // 10)][-calls:]
    return {
        f"{name}_median_us": float(np.median(taken)),
        f"{name}_p99_us": float(np.percentile(taken, 99)),
    }
