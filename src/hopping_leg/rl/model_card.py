"""Write a policy's model card from the results of its training."""

from pathlib import Path
from typing import Any

from hopping_leg.controllers.registry import ROBOT_FILE
from hopping_leg.io import write_atomically
from hopping_leg.rl.run_folder import read_result
from hopping_leg.robot import TIMESTEP, shipped_robots

MISSED = 0.02
"""Median error beyond which a policy misses its command, m; the robustness suite's."""


def write_card(folder: Path) -> Path:
    """Write ``model_card.md`` into a run's folder from its ``result.json``."""
    path = folder / "model_card.md"
    write_atomically(path, render(read_result(folder)).encode())
    return path


def render(result: dict[str, Any]) -> str:
    """Return the card of a finished training, as Markdown, from its ``result.json``."""
    selected, task, name = result["selected"], result["options"]["task"], result["robot"]
    commands = task["command_range"] or (min(task["commands"]), max(task["commands"]))
    versions = ", ".join(f"{name} {number}" for name, number in result["versions"].items())
    robot = f"`{name}`" if name in shipped_robots() else f"{name}, `{ROBOT_FILE}` in this folder"
    any_leg = result["options"]["legs"] == "any"
    legs = "any leg of this kind;\nthe trials below are on" if any_leg else "robot"
    steps, minutes, tried = selected["steps"], selected["minutes"], len(result["history"])
    chosen = (
        f"- Selection: the policy after {steps} steps ({minutes:.1f} min) of {tried} snapshots.\n"
    )
    return f"""# Policy `{result["recipe"]}`, seed {result["seed"]}

One network from joint measurements to joint torques, for {legs} {robot}
(parameters {result["robot_digest"]}), commands {commands[0]:g} to {commands[1]:g} m,
{task["rate"]:g} Hz. Made by

    {result["command"]}

- Training: {result["steps"]} control steps, {result["minutes"]:.1f} min of wall-clock time, physics
  step {1000 * task["timestep"]:g} ms.
{_stages(result["stages"])}{chosen if tried > 1 else ""}- Versions: {versions}.

Trials on the selection seeds {", ".join(map(str, selected["seeds"]))}, noise and delay on, physics
step {1000 * TIMESTEP:g} ms, the first 2 s of each trial dropped. These seeds chose the policy;
`hop evaluate policy.onnx` judges it on others, in this folder.

| command m | median error mm | std mm | hops/s | flight % | skipped | body contact ticks\
 | lowest base m |
|---|---|---|---|---|---|---|---|
{"".join(map(_row, selected["trials"]))}{missed_commands(selected["trials"])}"""


def _stages(rows: list[dict[str, Any]]) -> str:
    """Return lines on the stages of a distillation, if it was one."""
    shown = "".join(
        f"  - {row['name']}: {row['score']} {_mm(row['score_m'])} mm"
        f" after {row['seconds']:.0f} s, {'passed' if row['passed'] else '**not passed**'}"
        f" (at most {1000 * row['must_score_m']:g} mm)\n"
        for row in rows
    )
    return f"- Stages:\n{shown}" if rows else ""


def _row(trial: dict[str, Any]) -> str:
    """Return the line of a command's trials in the table."""
    cells = (
        _height(trial["command_m"]),
        _mm(trial["median_error_m"]),
        _mm(trial["std_m"]),
        f"{trial['hops_per_s']:.2f}",
        f"{100 * trial['flight_fraction']:.0f}",
        f"{trial['skipped_hops']} of {trial['hops'] + trial['skipped_hops']}",
        str(trial["body_contact_ticks"]),
        f"{trial['min_height_m']:.3f}",
    )
    return f"| {' | '.join(cells)} |\n"


def missed_commands(trials: list[dict[str, Any]]) -> str:
    """Return a paragraph on the commands that a policy misses in its own simulation, if any."""
    missed = [
        f"{_height(command)} m ({'no hops' if error is None else f'{1000 * error:+.0f} mm'})"
        for command, error in ((t["command_m"], t["median_error_m"]) for t in trials)
        if error is None or abs(error) > MISSED
    ]
    if not missed:
        return ""
    return f"""
**Commands missed in its own simulation: {", ".join(missed)}.** Train longer or from another seed
before this policy goes to any other leg.
"""


def _mm(metres: float | None) -> str:
    return "no hops" if metres is None else f"{1000 * metres:.1f}"


def _height(metres: float) -> str:
    """Return a command to the centimetre, or to the millimetre where it is finer."""
    return f"{metres:.2f}" if abs(metres - round(metres, 2)) < 1e-9 else f"{metres:.3f}"
