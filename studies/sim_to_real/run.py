"""The study's experiments: train and hop on twins, or hop on legs without any training."""

from dataclasses import dataclass

from hopping_leg.cli.options import mm, say, show_table
from studies.shared import Row
from studies.sim_to_real.chain import Chain, Experiment
from studies.sim_to_real.tables import tabulate
from studies.sim_to_real.zero_shot import ZeroShot


@dataclass(frozen=True)
class Transfer(Experiment):
    """Train on what is known of each twin, and hop on it."""

    def measure(self) -> Row:
        """Run the experiment, or what is left of it; print the tables, return every number."""
        chain = Chain(self)
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


def show_transfer(result: Row) -> None:
    """Print the tables of sim-to-real trials."""
    show_table(
        ("trained on", "command, m", "|error|, mm", "from", "to", "error, mm", "hops", "skipped"),
        (
            (r["method"], f"{r['command_m']:.2f}",
             *(mm(r[f"median_abs_error{end}_m"]) for end in ("", "_low", "_high")),
             mm(r["median_error_m"]),
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


Options = Transfer | ZeroShot
