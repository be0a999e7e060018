"""A recording's table while it is being checked."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from hopping_leg.arrays import Array
from hopping_leg.identify.recording_format import RecordingMetadata


@dataclass
class Inspection:
    """What the checks know.

    Attributes:
        table: In a recording's columns and types; null where nothing was recorded.
        metadata: How it was recorded.
        origin: The file, for messages.
        names: The file's own column for a recording's column, where they differ.
        warnings: What was strange so far, a sentence each.
    """

    table: pl.DataFrame
    metadata: RecordingMetadata
    origin: str
    names: Mapping[str, str] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def named(self, column: str) -> str:
        """Return a column as the file calls it, in quotes."""
        own = self.names.get(column, column)
        return f"column '{own}'" if own == column else f"column '{own}' ({column})"

    def row(self, index: int) -> int:
        """Return the file's row of a row of the table."""
        return int(self.table["row"][int(index)]) if "row" in self.table.columns else index

    def values(self, column: str) -> pl.Series:
        """Return a column, all null if there is none."""
        if column in self.table.columns:
            return self.table[column]
        return pl.Series(column, [None] * self.table.height, dtype=pl.Float64)

    def floats(self, column: str) -> Array:
        """Return a column as floats, (ticks,), NaN where null."""
        values: Array = self.values(column).cast(pl.Float64).to_numpy()
        return np.asarray(values, dtype=np.float64)

    def warn(self, sentence: str) -> None:
        """Note something strange; the sentence gets the file and a full stop."""
        self.warnings.append(f"{self.origin}: {sentence}.")

    def without(self, column: str) -> pl.DataFrame:
        """Return the table with a column as if it had not been recorded."""
        return self.table.with_columns(pl.lit(None, dtype=self.table[column].dtype).alias(column))
