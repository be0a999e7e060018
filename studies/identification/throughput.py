"""What a candidate costs: simulated in one batch, and in a plain loop, in turn in the same run."""

from collections.abc import Callable
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.simulate import WindowSimulator
from hopping_leg.identify.windows import cut
from hopping_leg.robot.model import TIMESTEP
from studies.identification.plain_loop import PlainLoop
from studies.identification.study import Study
from studies.identification.twin import believed, record_paper
from studies.timing import Timed, host, interleave, median_ratio


def throughput(
    study: Study, on_repeat: Callable[[int, int], None] = lambda done, total: None
) -> dict[str, Any]:
    """Time a generation on the paper's recordings.

    Each loop simulates one candidate, each batch a whole generation; all simulate the same
    windows, steps and PD, which is checked.

    Args:
        study: Length of the recordings, candidates, rounds.
        on_repeat: Called with (rounds done, rounds in all).

    Returns:
        Seconds per candidate, and how many times faster the batch is, on one thread and on two.
    """
    recordings = record_paper(study.throughput_seconds)
    plan = make_plan(recordings, believed(), search="two-pass")
    windows = cut(recordings, plan.window, unscored=plan.unscored)
    rng = np.random.default_rng(study.seed)
    low, high = (np.clip(bound, -1, 1) for bound in plan.parameters.bounds)
    vectors = rng.uniform(low, high, (study.population, len(low)))
    candidates = plan.parameters.hypotheses(vectors)
    loop = PlainLoop(recordings, windows, TIMESTEP)
    batches = {
        threads: WindowSimulator(recordings, windows, timestep=TIMESTEP, threads=threads)
        for threads in (1, 2)
    }
    functions: dict[str, Timed] = {
        "loop": lambda: _run_loop(loop, candidates[0], whole_ticks=False),
        "loop_ticks": lambda: _run_loop(loop, candidates[0], whole_ticks=True),
        "batch_1": lambda: _run_batch(batches[1], candidates),
        "batch_2": lambda: _run_batch(batches[2], candidates),
    }
    taken = interleave(functions, study.repeats, on_repeat)
    per = {n: t / (study.population if n.startswith("batch") else 1) for n, t in taken.items()}
    return {
        "rows": [
            _row("Python loop, one physics step per mj_step call", per["loop"], per["loop"]),
            _row("Python loop, one control period per call", per["loop_ticks"], per["loop"]),
            _row("batch, one thread", per["batch_1"], per["loop"]),
            _row("batch, two threads", per["batch_2"], per["loop"]),
        ],
        "batch_one_thread_over_loop": median_ratio(per["loop"], per["batch_1"]),
        "batch_two_threads_over_loop": median_ratio(per["loop"], per["batch_2"]),
        "batch_two_threads_over_one": median_ratio(per["batch_1"], per["batch_2"]),
        "largest_difference_rad": _difference(loop, batches[1], candidates[0]),
        "recorded_s": 2 * study.throughput_seconds,
        "paper_size_share": study.throughput_seconds / 240.0,
        "windows": len(windows),
        "window_s": plan.window,
        "candidates": study.population,
        "timestep_s": TIMESTEP,
        "repeats": study.repeats,
        "host": host(),
    }


def _row(what: str, seconds: Array, loop: Array) -> dict[str, Any]:
    return {
        "what": what,
        "s_per_candidate": float(np.median(seconds)),
        "times_faster": median_ratio(loop, seconds),
    }


def _run_loop(loop: PlainLoop, candidate: LegHypothesis, *, whole_ticks: bool) -> None:
    loop.run(candidate, whole_ticks=whole_ticks)


def _run_batch(batch: WindowSimulator, candidates: list[LegHypothesis]) -> None:
    batch.run(candidates)


def _difference(loop: PlainLoop, batch: WindowSimulator, candidate: LegHypothesis) -> float:
    """Return the largest difference of a joint position between the two ways, rad."""
    plain, batched = loop.run(candidate), batch.run([candidate]).position[0]
    pairs = zip(plain, batched, strict=True)
    return float(max(np.abs(rows - other[: len(rows)]).max() for rows, other in pairs))
