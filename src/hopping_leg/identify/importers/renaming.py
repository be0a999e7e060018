"""What the rigs' importers share."""

from collections.abc import Mapping

import numpy as np
import polars as pl

from hopping_leg.identify.columns import PAIRS


def joint_columns(patterns: Mapping[str, str], joints: tuple[str, str]) -> dict[str, str]:
    """Return a recording's column for each column of a rig.

    Args:
        patterns: Quantity of ``PAIRS`` to the rig's name for it, with ``{}`` for the joint.
        joints: What the rig calls hip and knee.
    """
    return {
        pattern.format(joint): column
        for quantity, pattern in patterns.items()
        for joint, column in zip(joints, PAIRS[quantity], strict=True)
    }


def take(table: pl.DataFrame, names: Mapping[str, str]) -> pl.DataFrame:
    """Return the columns that are there, under their new names, and the file's row numbers."""
    present = {old: new for old, new in names.items() if old in table.columns}
    return table.select(pl.col(old).alias(new) for old, new in present.items()).with_columns(
        pl.int_range(pl.len()).alias("row")
    )


def median_rate(time: pl.Series) -> float:
    """Return the rate of a clock that was never stated, Hz, to three digits; 1 where unknown."""
    known = time.drop_nulls().to_numpy()
    steps = np.diff(known[np.isfinite(known)])
    step = float(np.median(steps)) if len(steps) else 0.0
    return float(f"{1 / step:.3g}") if 0 < step < np.inf else 1.0
