"""Judge all submissions and rank them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from hopping_leg.cli.options import at_least, going_on, show_table
from hopping_leg.evaluate import runner
from hopping_leg.evaluate.robustness import outcome, trials
from hopping_leg.evaluate.statistics import twins_note
from hopping_leg.evaluate.trials import COMMANDS
from hopping_leg.robot import load_robot
from hopping_leg.sim_to_real.jobs import work_through
from studies.leaderboard.judging import AXES, SEED, judgements
from studies.leaderboard.submissions import ROBOT, find_submissions


@dataclass(frozen=True)
class Leaderboard:
    """Who is judged, and on how many legs."""

    submissions: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    """Names of folders in `submissions/`; default: all."""
    twins: int = 50
    """Drawn legs, a trial at each command on each."""
    seeds: int = 10
    """Realisations of noise, delay and perturbation of every changed leg and command."""
    seconds: float = trials.SECONDS
    """Duration of each trial, s."""
    jobs: int = 2
    """Submissions that are judged at once."""
    folder: Path = Path("runs/leaderboard")
    """Where results are kept; what is there is not done again."""
    json: Path | None = None
    """Write every number to this file."""

    def measure(self) -> dict[str, Any]:
        """Judge, print the table, return every number."""
        at_least(1, twins=self.twins, seeds=self.seeds, jobs=self.jobs)
        chosen = find_submissions(self.submissions)
        pairs = judgements(chosen, self.folder, self.twins, self.seeds, self.seconds)
        with going_on(f"the same command goes on with what is in {self.folder}."):
            work_through([[job for pair in pairs for job in pair]], self.jobs)
        rows, scores = [], []
        for one, (on_twins, on_axes) in zip(chosen, pairs, strict=True):
            *axes, overall = on_axes.scores()
            scores += axes
            rows.append(
                {"submission": one.name, "authors": ", ".join(one.facts.authors)}
                | {"controller": one.facts.controller or one.name, "robot": one.robot().name}
                | {"made_by": one.facts.command, "digest": on_twins.digest, **on_twins.row()}
                | {"robustness": overall["score"]}
                | {f"robustness_{end}": overall[end] for end in ("low", "high")}
            )
        rows.sort(key=lambda row: (-row["twins"], -row["robustness"]))
        show_table(
            ("submission", "twins, %", "error, mm", "changed legs, %"),
            ([r["submission"], *_shares(r)] for r in rows),
        )
        return {
            "submissions": rows,
            "scores": scores,
            "conditions": {
                "robot": ROBOT,
                "robot_digest": load_robot(ROBOT).digest,
                "commands_m": list(COMMANDS),
                "twins": self.twins,
                "seeds": self.seeds,
                "seed": SEED,
                "seconds": self.seconds,
                "tolerance_m": outcome.TOLERANCE,
                "axes": list(AXES),
            },
            "notes": twins_note(self.twins),
            "versions": runner.software_versions(),
        }


def _shares(row: dict[str, Any]) -> list[str]:
    def share(name: str) -> str:
        score, low, high = (100 * row[f"{name}{end}"] for end in ("", "_low", "_high"))
        return f"{score:.0f} [{low:.0f}, {high:.0f}]"

    return [share("twins"), f"{1e3 * row['median_abs_error_m']:.1f}", share("robustness")]
