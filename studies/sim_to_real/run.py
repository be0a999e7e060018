"""The study's experiments: train and hop on twins, or hop on legs without any training."""

from dataclasses import dataclass

from hopping_leg.cli.options import say
from studies.shared import Row, show_rows
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
        errors = ("median_abs_error_m", "median_abs_error_low_m", "median_abs_error_high_m")
        show_rows(result["rows"], "method", "command_m", *errors, "hops", "skipped_hops")
        show_rows(result["methods"], "method", *errors, "ordered", "policies")
        show_rows(result["comparison"], "method", "over", "ratio", "ratio_low", "ratio_high")
        say(*(f"Note: {note}" for note in result["notes"]))
        return result


Options = Transfer | ZeroShot
