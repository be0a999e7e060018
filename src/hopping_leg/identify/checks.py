"""What the loader rejects, and what it repairs and warns about."""

import polars as pl

from hopping_leg.errors import RecordingError
from hopping_leg.identify.setup import RecordingSetup


def check_table(
    table: pl.DataFrame, setup: RecordingSetup, origin: str
) -> tuple[pl.DataFrame, list[str]]:
    """Return a table that can be believed, and a sentence for each thing that was strange.

    Args:
        table: In a recording's columns and types, null where nothing was recorded.
        setup: How it was recorded.
        origin: The file, for messages.

    Raises:
        RecordingError: Naming file, column and row.
    """
    for name in ("time_s",):
        if name not in table.columns:
            raise RecordingError(f"{origin}: column '{name}' is missing.")
    return table, []
