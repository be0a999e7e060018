"""The same data fitted with MuJoCo's own identification toolbox, mujoco.sysid."""

import contextlib
import functools
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.recording import Recording
from studies.identification.fits import compare, summary, unseen_errors
from studies.identification.study import Clock, FitCache, Study
from studies.identification.synthetic import CASES, FIXED, RAIL
from studies.identification.twin import believed, record

ITERATIONS = 60
"""Most steps that its search may take."""

SETTINGS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("defaults, PD in the model", "whole", {}),
    ("tuned, PD in the model", "whole", {"eps": 1e-4, "x_scale": "jac"}),
    ("tuned, torque-driven windows", "windows", {"eps": 1e-4, "x_scale": "jac"}),
)
"""In words, way of cutting, settings of its search: its own, and those that work here."""

INSTALL = "mujoco.sysid is not installed; run `pip install 'hopping-leg[bench]'`."


def available() -> bool:
    """Return whether mujoco.sysid has all that it needs."""
    from mujoco import sysid

    return hasattr(sysid, "optimize")


def mujoco_sysid(study: Study, cache: FitCache, fits: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Fit the twins on fixed base and rail, with the parameters and bounds of least squares.

    Args:
        study: Efforts.
        cache: Keeps each fit.
        fits: Rows of the known twins' fits.

    Returns:
        ``rows``, a record per case and setting; or ``missing``, a sentence.
    """
    if not available():
        return {"missing": INSTALL, "rows": []}
    rows = []
    for row in fits:
        if row["case"] not in (FIXED, RAIL) or row["method"] != "least squares":
            continue
        searched = [p for p in row["parameters"] if not p["name"].startswith("drive.")]
        bounds = {p["name"]: (p["start"], p["low"], p["high"]) for p in searched}
        for words, way, settings in SETTINGS:
            name = f"sysid-{CASES[row['case']][0]}-{words.replace(', ', '-').replace(' ', '-')}"
            found = cache.load_or_run(
                name,
                f"mujoco.sysid, {row['case']}: {words}",
                {**study.asked("least-squares", study.seconds), "bounds": bounds, "way": way},
                functools.partial(_fit, study, cache, row["case"], bounds, way, settings),
            )
            rows.append({"case": row["case"], "method": f"mujoco.sysid, {words}", **found})
    return {"rows": rows}


def _fit(
    study: Study,
    cache: FitCache,
    case: str,
    bounds: dict[str, tuple[float, float, float]],
    way: Any,  # noqa: ANN401
    settings: dict[str, Any],
) -> dict[str, Any]:
    from mujoco import sysid

    from studies.identification.sequences import sequences

    _, truth, fitted, judged, _ = CASES[case]
    recordings = [record(truth, motion, study.seconds) for motion in fitted]
    names = tuple(bounds)
    parameters = sysid.ParameterDict()
    for name, (start, low, high) in bounds.items():
        parameters.add(sysid.Parameter(name, start, low, high))
    parameters.move_off_bounds()
    with Clock() as clock:
        cut = [sequences(recording, way) for recording in recordings]
        least, jacobians = np.inf, 0

        def residuals(x: Array, values: Any) -> tuple[list[Array], list[Any], list[Any]]:  # noqa: ANN401
            nonlocal least, jacobians
            found = [
                sysid.model_residual(
                    x,
                    values,
                    lambda p, build=one.build: build(names, tuple(p.as_vector().tolist())),
                    trajectory,
                    n_threads=study.threads,
                )[0]
                for one in cut
                for trajectory in one.trajectories
            ]
            if x.ndim == 1:
                least = min(least, sum(float(np.square(part).sum()) for part in found))
            jacobians += x.ndim > 1
            cache.report("mujoco.sysid", min(jacobians / ITERATIONS, 1.0), least)
            return found, [], []

        with contextlib.redirect_stdout(io.StringIO()):
            best, _ = sysid.optimize(
                parameters, residuals, "mujoco", verbose=False, max_iters=ITERATIONS, **settings
            )
    values = dict(zip(names, best.as_vector().tolist(), strict=True))
    rows = compare(values, truth, None)
    candidate = LegHypothesis(believed()).replace(values)
    unseen: dict[str, Recording] = {
        motion: record(truth, motion, study.seconds) for motion in judged
    }
    return {
        **summary(rows),
        **unseen_errors(candidate, unseen, study.threads),
        "wall_s": clock.wall,
        "cpu_s": clock.cpu,
        "parameters": rows,
    }
