"""Draw what stored traces show: heights over time, distributions, ladder, phase space.

Examples:
  hop report runs/first/traces/*.parquet --out runs/first/figures
  hop report runs/first/traces/*-fixed-*.parquet --format pdf
  hop report runs/deploy/*.parquet --prediction prediction.json
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from hopping_leg import errors, io
from hopping_leg.cli.options import say, show_table


@dataclass(frozen=True)
class Report:
    """Draw the figures of stored traces."""

    traces: tyro.conf.Positional[tuple[Path, ...]]
    """Parquet files from `hop evaluate --out DIR` or `hop deploy`; also the .blackbox that a
    killed `hop deploy` leaves, whose trace is then written beside it."""
    out: Path = Path("figures")
    """Folder for the figures."""
    format: Literal["svg", "pdf", "png"] = "svg"
    """Kind of file."""
    prediction: Path | None = None
    """JSON of `hop evaluate --posterior`: say whether the traces are within what it predicts."""


def run(args: Report) -> None:
    """Draw figures."""
    if not args.traces:
        raise errors.UsageError("No trace was named; record some with `hop evaluate --out DIR`.")
    from hopping_leg import flight_recording
    from hopping_leg.evaluate import prediction, report, result, trials
    from hopping_leg.figures import encode

    for path in args.traces:
        if path.suffix == flight_recording.SUFFIX:
            flight_recording.recover(path).save(path.with_suffix(".parquet"))
    runs = [trials.load_run(path) for path in args.traces]
    if args.prediction:
        compared, sentences = prediction.compare(args.prediction, runs)
        show_table(*prediction.shown(compared))
        say(*sentences)
    evaluation = result.tabulate(runs, seed=0)
    for name, figure in report.draw_report_figures(evaluation, runs).items():
        path = args.out / f"{name}.{args.format}"
        io.write_atomically(path, encode(figure, args.format))
        say(path)
