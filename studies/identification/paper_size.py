"""Identification at the paper's size: 240 s in the air and 240 s on the ground."""

from typing import Any

from studies.identification.fits import fit
from studies.identification.study import FitCache, Study
from studies.identification.synthetic import BEYOND_TABLE
from studies.identification.twin import GROUND, record, record_paper


def paper_size(study: Study, cache: FitCache, method: str) -> dict[str, Any]:
    """Identify the twin from recordings of the paper's size.

    Args:
        study: Length of the recordings and effort.
        cache: Has the checkpoints: a killed fit goes on, and then says that it was resumed.
        method: How to search.

    Returns:
        As ``fits.fit``, with minutes.
    """
    unseen = {
        motion: record(GROUND, motion, study.seconds)
        for motion in ("other swings", "other squats", "other hops")
    }
    parameters = BEYOND_TABLE if method == "two-pass" else None
    found = fit(
        study,
        cache,
        f"paper-size-{method}",
        method,
        record_paper(study.paper_seconds),
        unseen,
        GROUND,
        parameters,
    )
    return {
        "recorded_s": 2 * study.paper_seconds,
        "wall_minutes": found["wall_s"] / 60,
        "cpu_minutes": found["cpu_s"] / 60,
        **found,
    }
