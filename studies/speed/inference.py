"""How long a policy takes from measurement to torque for one leg on one thread."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import tyro
from rich.table import Table

from hopping_leg.arrays import Array
from hopping_leg.cli.options import at_least
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_policy, shipped_policies
from hopping_leg.errors import UsageError
from hopping_leg.sim import SAMPLES, Measurement
from hopping_leg.terminal import plain_console
from studies.shared import host


def bench_inference(policies: Sequence[str], calls: int = 5000) -> dict[str, Any]:
    """Time policies.

    Args:
        policies: Names or files; all shipped ones if empty.
        calls: Timed calls of each.

    Returns:
        ``inference_median_us`` (the slowest policy's) and ``rows``, one per policy: the network
        alone through onnxruntime, and the whole controller with its checks and history.

    Raises:
        UsageError: There is no policy to time.
        PolicyError: A file is no policy.
    """
    names = list(policies) or shipped_policies()
    if not names:
        raise UsageError("No policy is shipped with this version; name an .onnx file to time.")
    rows = [_row(load_policy(name), calls) for name in names]
    slowest = max(row["inference_median_us"] for row in rows)
    return {"inference_median_us": slowest, "rows": rows, "host": host()}


def _row(policy: Policy, calls: int) -> dict[str, Any]:
    network, controller = _network_times(policy, calls), _controller_times(policy, calls)
    return {
        "policy": policy.name,
        "inference_median_us": float(np.median(network)),
        "inference_p99_us": float(np.percentile(network, 99)),
        "controller_median_us": float(np.median(controller)),
        "controller_p99_us": float(np.percentile(controller, 99)),
        "calls": calls,
    }


def _network_times(policy: Policy, calls: int) -> Array:
    """Return the duration of each run of the bare network, us, (calls,)."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(
        policy.content, options, providers=["CPUExecutionProvider"]
    )
    rng = np.random.default_rng(0)
    feeds = {
        name: rng.standard_normal((1, *shape)).astype(np.float32)
        for name, shape in policy.inputs.items()
    }
    return _times(lambda: session.run(None, feeds), calls)


def _controller_times(policy: Policy, calls: int) -> Array:
    """Return the duration of each decision of the controller, us, (calls,)."""
    rng = np.random.default_rng(0)
    shape = (1, SAMPLES, 2)
    command = np.full((1, SAMPLES), sum(policy.command_range) / 2)
    age = np.arange(SAMPLES)[None] / policy.card.rate
    seen = Measurement(rng.standard_normal(shape), rng.standard_normal(shape), command, age)
    policy.reset(1)
    return _times(lambda: policy.act(seen), calls)


def _times(call: Any, calls: int) -> Array:  # noqa: ANN401
    taken = np.empty(calls)
    for _ in range(calls // 10):
        call()
    for i in range(calls):
        start = time.perf_counter_ns()
        call()
        taken[i] = time.perf_counter_ns() - start
    return taken / 1000


@dataclass(frozen=True)
class Inference:
    """Time policies on one thread, from measurement to torque."""

    policies: tyro.conf.Positional[tuple[str, ...]] = ()
    """Shipped names or .onnx files; all shipped ones by default."""
    calls: int = 5000
    """Timed decisions of each."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Run it, print a table, return every number."""
        at_least(1, calls=self.calls)
        result = bench_inference(self.policies, self.calls)
        table = Table("policy", "network, median us", "99 %", "whole controller, median us", "99 %")
        for row in result["rows"]:
            times = ("inference_median_us", "inference_p99_us", "controller_median_us")
            cells = [f"{row[name]:.1f}" for name in (*times, "controller_p99_us")]
            table.add_row(row["policy"], *cells)
        plain_console().print(table)
        return result
