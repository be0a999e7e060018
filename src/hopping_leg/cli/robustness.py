"""`hop evaluate --suite robustness`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hopping_leg.errors import UsageError
from hopping_leg.evaluate.figures import draw_robustness, to_svg
from hopping_leg.evaluate.keeper import Keeper
from hopping_leg.evaluate.robustness.suite import make_suite, run_suite
from hopping_leg.io import write_atomically, write_json

if TYPE_CHECKING:
    from collections.abc import Callable

    from hopping_leg.cli.evaluate import Evaluate
    from hopping_leg.controllers import RolloutConfig
    from hopping_leg.evaluate import Candidate

FOLDER = Path("runs/robustness")
"""Where results are kept unless ``--out`` says otherwise."""


def judge_robustness(
    args: "Evaluate",
    candidates: "list[Candidate]",
    setup: "RolloutConfig",
    on_progress: "Callable[[str, float], None]",
    command: str,
) -> dict[str, Any]:
    """Run the suite and write what was asked for.

    Args:
        args: The command line's.
        candidates: What is judged.
        setup: What they believe.
        on_progress: Called with a label and the share done.
        command: What makes this result again.

    Raises:
        UsageError: An option has no meaning here.
    """
    if args.engine != "mujoco":
        raise UsageError("The robustness suite needs MuJoCo; leave --engine out.")
    if args.floor != "both":
        raise UsageError("The ground is an axis of this suite; leave --floor out.")
    suite = make_suite(
        setup, axes=args.axes, commands=args.commands, repeats=args.seeds, seed=args.seed
    )
    keeper = Keeper(args.out or FOLDER)
    result = {"command": command, **run_suite(candidates, suite, keeper, on_progress)}
    file = args.json or (args.out / "robustness.json" if args.out else None)
    if file:
        write_json(file, result)
    if args.out:
        write_atomically(args.out / "robustness.svg", to_svg(draw_robustness(result)))
    return result
