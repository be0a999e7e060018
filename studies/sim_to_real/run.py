"""The study's experiments: train and hop on twins, or foretell a shipped controller's hops."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from hopping_leg.cli.options import mm, say, show_table
from hopping_leg.controllers.registry import ENERGY_SHAPING
from hopping_leg.errors import UsageError
from hopping_leg.evaluate.statistics import twins_note
from studies.shared import Row
from studies.sim_to_real.chain import HOPPERS, Chain, Experiment
from studies.sim_to_real.methods import DEFAULT, FORETOLD, Method
from studies.sim_to_real.tables import median_over_twins, tabulate
from studies.sim_to_real.zero_shot import ZeroShot


@dataclass(frozen=True)
class Transfer(Experiment):
    """Train on what is known of each twin, and hop on it."""

    def measure(self) -> Row:
        """Run the experiment, or what is left of it; print the tables, return every number."""
        names = DEFAULT if self.methods is None else self.methods
        chain = Chain(self, (*names, ENERGY_SHAPING) if names else ())
        identification, trainings, trials = chain.identify(), chain.train(), chain.hop()
        result = {
            **chain.about(),
            "training_seeds": list(self.seeds),
            "recipe": self.recipe,
            "training_steps": self.steps,
            **tabulate({method.name: method.meaning for method in chain.methods}, trials),
            "identification": identification,
            "trainings": trainings,
        }
        show_transfer(result)
        return result


@dataclass(frozen=True)
class Prediction(Experiment):
    """Let each method's simulation foretell a shipped policy's hops on the twins."""

    def measure(self) -> Row:
        """Run the experiment, print the numbers and return them."""
        chain = Chain(self, FORETOLD if self.methods is None else self.methods)
        for method in chain.methods:
            if not method.simulates:
                raise UsageError(
                    f"The method '{method.name}' believes in no one leg, so that none foretells;"
                    f" name others, e.g. {', '.join(FORETOLD)}."
                )
        identification, foretold = chain.identify(), chain.foretell()
        methods = [prediction_row(m, hopper, foretold) for hopper in HOPPERS for m in chain.methods]
        show_table(
            ("controller", "method", "|error|, mm", "from", "to"),
            (
                (r["controller"], r["method"], *_mm(r, "median_abs_error", ("", "_low", "_high")))
                for r in methods
            ),
        )
        notes = twins_note(len(chain.twins))
        say(*(f"Note: {note}" for note in notes))
        return {
            **chain.about(),
            "methods": methods,
            "identification": identification,
            "notes": notes,
        }


def prediction_row(method: Method, hopper: str, foretold: Iterable[Row]) -> Row:
    """Return how far a method's predicted apexes are off, over twins and commands.

    A leg that does not hop counts with the height in which it stands.
    """
    own = [r for r in foretold if (r["method"], r["controller"]) == (method.name, hopper)]
    errors = [(row["twin"], error) for row in own for error in row["errors_m"]]
    absolute = [{"twin": twin, "median_abs_error_m": abs(error)} for twin, error in errors]
    return {
        "controller": hopper,
        "method": method.name,
        "meaning": method.meaning,
        **median_over_twins(absolute, "median_abs_error_m"),
        "worst_abs_error_m": max(abs(error) for _, error in errors),
        "median_error_m": float(np.median([error for _, error in errors])),
        "errors_m": {row["twin"]: row["errors_m"] for row in own},
    }


def show_transfer(result: Row) -> None:
    """Print the tables of sim-to-real trials."""
    show_table(
        ("trained on", "command, m", "|error|, mm", "from", "to", "error, mm", "hops", "skipped"),
        (
            (r["method"], f"{r['command_m']:.2f}",
             *_mm(r, "median_abs_error", ("", "_low", "_high")), mm(r["median_error_m"]),
             r["hops"], r["skipped_hops"])
            for r in result["rows"]
        ),
    )  # fmt: skip
    for row in result["methods"]:
        say(
            f"{row['method']}: {mm(row['median_abs_error_m'])} mm over all commands,"
            f" {row['ordered']} of {row['policies']} policies in order"
        )
    for row in result["comparison"]:
        say(
            f"{row['method']} errs {row['ratio']:.1f} times as much as {row['over']}"
            f" ({row['ratio_low']:.1f} to {row['ratio_high']:.1f})"
        )
    say(*(f"Note: {note}" for note in result["notes"]))


def _mm(row: Row, name: str, ends: Iterable[str]) -> list[str]:
    return [mm(row[f"{name}{end}_m"]) for end in ends]


Options = Transfer | Prediction | ZeroShot
