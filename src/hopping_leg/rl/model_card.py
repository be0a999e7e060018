"""Write a policy's model card from the results of its training."""

from pathlib import Path
from typing import Any

from hopping_leg.io import write_atomically
from hopping_leg.rl.run_folder import read_result
from hopping_leg.robot import TIMESTEP

MISSED = 0.02
"""Median error beyond which a policy misses its command, m; the robustness suite's."""


def write_card(folder: Path) -> Path:
    """Write ``model_card.md`` into a run's folder from its ``result.json``."""
    path = folder / "model_card.md"
    write_atomically(path, render(read_result(folder)).encode())
    return path


def render(result: dict[str, Any]) -> str:
    """Return the card of a finished training, as Markdown, from its ``result.json``."""
    selected, task = result["selected"], result["options"]["task"]
    commands = task["command_range"] or (min(task["commands"]), max(task["commands"]))
    versions = ", ".join(f"{name} {number}" for name, number in result["versions"].items())
    return f"""# Policy `{result["recipe"]}`, seed {result["seed"]}

One network from joint measurements to joint torques, for robot `{result["robot"]}`
(parameters {result["robot_digest"]}), commands {commands[0]:g} to {commands[1]:g} m,
{task["rate"]:g} Hz. Made by

    {result["command"]}

- Training: {result["steps"]} control steps, {result["minutes"]:.1f} min of wall-clock time, physics
  step {1000 * task["timestep"]:g} ms.
{parallel_seeds(result)}\
{curriculum(result.get("curriculum", []))}\
{teacher_scores(result.get("teacher_scores_m", []))}\
- Selection: the policy after {selected["steps"]} steps ({selected["minutes"]:.1f} min), the best of
  {len(selected["finalists"])} finalists out of {len(result["history"])} snapshots.
- Versions: {versions}.

Trials on the selection seeds {", ".join(map(str, selected["seeds"]))}, noise and delay on, physics
step {1000 * TIMESTEP:g} ms, the first 2 s of each trial dropped. These seeds chose the policy;
`hop evaluate {result["recipe"]}` judges it on others.

{table(selected["trials"])}
{missed_commands(selected["trials"])}"""


def parallel_seeds(result: dict[str, Any]) -> str:
    """Return a line on the trainings of which this was the best, if there were several."""
    if "seed_scores" not in result:
        return ""
    rows = result["seed_scores"]
    scores = ", ".join(f"{1000 * row['score_m']:.1f} mm (seed {row['seed']})" for row in rows)
    chosen = rows[result["chosen_seed"]]["seed"]
    return (
        f"- Parallel seeds: the training with seed {chosen}, the best of {len(rows)} when they"
        f" could be compared, less being better:\n  {scores}.\n"
    )


def curriculum(stages: list[dict[str, Any]]) -> str:
    """Return a line on who learnt until when, if there was more than one."""
    shown = ", ".join(
        f"{s['name']} until {100 * s['until']:.0f} %"
        + (f" (accepted from {1000 * s['must_score']:g} mm)" if s["must_score"] else "")
        for s in stages
    )
    return f"- Curriculum, at the latest: {shown} of the training.\n" if stages else ""


def teacher_scores(scores: list[float]) -> str:
    """Return a line on the teachers' scores, m, if there were any."""
    numbers = ", ".join(f"{1000 * score:.1f}" for score in scores)
    return (
        f"- Evaluations of the teachers in order: {numbers} mm where they"
        " did worst (less is better); who did best taught.\n"
        if scores
        else ""
    )


def missed_commands(trials: list[dict[str, Any]]) -> str:
    """Return a paragraph on the commands that a policy misses in its own simulation, if any."""
    errors = {t["command_m"]: t["median_error_m"] for t in trials}
    missed = [
        f"{_height(command)} m ({'no hops' if error is None else f'{1000 * error:+.0f} mm'})"
        for command, error in errors.items()
        if error is None or abs(error) > MISSED
    ]
    if not missed:
        return ""
    return f"""
**Commands missed in its own simulation: {", ".join(missed)}.** Train longer or from another seed
before this policy goes to any other leg.
"""


def table(trials: list[dict[str, Any]]) -> str:
    """Return trials as a Markdown table."""
    head = (
        "| command m | median error mm | std mm | hops/s | flight % | skipped | body contact ticks"
        " | lowest base m |\n|---|---|---|---|---|---|---|---|"
    )
    rows = [
        f"| {_height(t['command_m'])} | {_mm(t['median_error_m'])} | {_mm(t['std_m'])}"
        f" | {t['hops_per_s']:.2f} | {100 * t['flight_fraction']:.0f} | {t['skipped_hops']}"
        f" of {t['hops'] + t['skipped_hops']} | {t['body_contact_ticks']}"
        f" | {t['min_height_m']:.3f} |"
        for t in trials
    ]
    return "\n".join([head, *rows])


def _mm(metres: float | None) -> str:
    return "no hops" if metres is None else f"{1000 * metres:.1f}"


def _height(metres: float) -> str:
    """Return a command to the centimetre, or to the millimetre where it is finer."""
    return f"{metres:.2f}" if abs(metres - round(metres, 2)) < 1e-9 else f"{metres:.3f}"
