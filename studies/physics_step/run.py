"""How fine the physics must step.

Single hops diverge after the first few whatever the step, since contact makes them chaotic. So what
is compared are medians and standard deviations of many hops under the same noise.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from rich.progress import track

from hopping_leg.cli.options import JsonFile, at_least, say
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_controller
from hopping_leg.evaluate.metrics import measure
from hopping_leg.robot import Robot, load_robot
from studies.shared import Row, show_rows

TOLERANCE = 0.5e-3
"""By how much halving the step may move a median or a standard deviation, m."""


@dataclass(frozen=True)
class PhysicsStep:
    """Let controllers hop at physics steps from 0.5 to 0.031 ms, each half of the one before."""

    controllers: tuple[str, ...] = ("energy-shaping", "paper", "fast", "rl")
    """Whose hops are compared; a policy hops on the robot that it was trained on alone."""
    robots: tuple[str, ...] = ("legv2", "legv2-paper", "legv2-identified")
    """Shipped names or paths of .toml files."""
    commands: tuple[float, ...] = (0.25, 0.30, 0.35)
    """Desired heights, m."""
    coarsest: float = 5e-4
    """First physics step, s."""
    halvings: int = 4
    """How often it is halved."""
    repeats: int = 24
    """Runs per command."""
    duration: float = 10.0
    """Of a run, s."""
    seed: int = 0
    """Of noise and delay, the same at every step."""
    json: JsonFile = None

    def measure(self) -> Row:
        """Run it, print a table, return every number."""
        at_least(1, halvings=self.halvings, repeats=self.repeats)
        pairs = [(n, load_robot(r)) for n in self.controllers for r in self.robots]
        pairs = [(name, robot) for name, robot in pairs if _fits(name, robot)]
        steps = [self.coarsest / 2**k for k in range(self.halvings + 1)]
        rows: list[Row] = []
        converge: list[Row] = []
        for name, robot in track(pairs, "hopping", transient=True):
            own = [row for step in steps for row in self._rows(name, robot, step)]
            about = {"controller": name, "robot": robot.name}
            converge.append({**about, "timestep_s": converged(own)})
            rows += own
        where = ("controller", "robot", "timestep_s", "command_m")
        show_rows(rows, *where, "median_error_m", "std_m", "hops")
        result = {
            "tolerance_m": TOLERANCE,
            "converged_timestep_s": converged(rows),
            "converged": converge,
            "rows": rows,
            "repeats": self.repeats,
            "duration_s": self.duration,
        }
        say(*(f"{r['controller']} on {r['robot']}: {_says(r['timestep_s'])}." for r in converge))
        say(f"All of them: {_says(converged(rows))}.")
        return result

    def _rows(self, name: str, robot: Robot, step: float) -> list[Row]:
        setup = RolloutConfig(robot, timestep=step)
        commands = np.repeat(self.commands, self.repeats)
        ticks = round(self.duration * setup.rate)
        controller = load_controller(name, robot)
        run = rollout(controller, setup, np.tile(commands, (ticks, 1)), self.seed)
        apexes = [measure(run.trace(leg))[0].apex for leg in range(len(commands))]
        rows = []
        for number, command in enumerate(self.commands):
            mine = apexes[number * self.repeats : (number + 1) * self.repeats]
            errors = np.concatenate(mine) - command
            some = [apex for apex in mine if len(apex)]
            row: Row = {
                "controller": name,
                "robot": robot.name,
                "timestep_s": step,
                "command_m": command,
                "hops": len(errors),
            }
            for key, of in (("median_error_m", np.median), ("std_m", np.std)):
                row[key] = float(of(errors)) if some else None
                spread = np.std([of(apex) for apex in some]) / len(some) ** 0.5 if some else 0.0
                row[f"{key}_standard_error"] = float(spread)
            rows.append(row)
        return rows


def _fits(name: str, robot: Robot) -> bool:
    controller = load_controller(name, robot)
    return not isinstance(controller, Policy) or controller.card.robot == robot.name


def converged(rows: list[Row]) -> float | None:
    """Return the coarsest step from which on halving changes no statistic.

    A median or standard deviation changes by more than ``TOLERANCE`` and two standard errors of
    the difference, runs being independent. The finest step has nothing to be compared with; None
    if even the one before it moves.
    """
    steps = sorted({row["timestep_s"] for row in rows})
    best = None
    for fine, coarse in itertools.pairwise(steps):
        one, other = ([r for r in rows if r["timestep_s"] == s] for s in (coarse, fine))
        if any(
            _moves(a, b, name)
            for a, b in zip(one, other, strict=True)
            for name in ("median_error_m", "std_m")
        ):
            break
        best = coarse
    return best


def _moves(one: Row, other: Row, name: str) -> bool:
    if one[name] is None or other[name] is None:
        return True
    error = np.hypot(one[f"{name}_standard_error"], other[f"{name}_standard_error"])
    return bool(abs(one[name] - other[name]) > max(TOLERANCE, 2 * error))


def _says(step: float | None) -> str:
    return "no step converges" if step is None else f"converged at {step * 1e3:g} ms"
