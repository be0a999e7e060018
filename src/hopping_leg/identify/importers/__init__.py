"""Recordings of other loggers, recognised by their columns; a module per rig.

Each rig's module has ``COLUMNS``, by which it is recognised, ``NAMES``, its columns and what a
recording calls them, and ``read(table)``, which returns a recording's table and metadata.
"""

from typing import Protocol

import polars as pl

from hopping_leg.identify.importers import (
    doublependulum,
    legv1_rail,
    legv2_boom,
    legv2_fixed_base,
)
from hopping_leg.identify.recording_format import RecordingMetadata

Imported = tuple[pl.DataFrame, RecordingMetadata]


class Importer(Protocol):
    """A rig's module."""

    COLUMNS: frozenset[str]
    NAMES: dict[str, str]

    def read(self, table: pl.DataFrame) -> Imported:
        """Return a recording's table and metadata from the rig's own table."""
        ...


IMPORTERS: dict[str, Importer] = {
    "legv2_fixed_base": legv2_fixed_base,
    "legv1_rail": legv1_rail,
    "legv2_boom": legv2_boom,
    "doublependulum": doublependulum,
}
"""Rigs by name."""


def recognise(columns: list[str]) -> Importer | None:
    """Return the importer whose columns a table has, or none."""
    for importer in IMPORTERS.values():
        if importer.COLUMNS.issubset(columns):
            return importer
    return None
