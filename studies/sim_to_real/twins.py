"""Twins, which play the real leg, and what is believed of them without a recording.

A twin brings latency, noise and losses of its own; the paper's disturbance comes on top, or stays
off: with ``own`` it meets only legs without [reality].
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any, Literal

from hopping_leg.controllers import Controller
from hopping_leg.controllers.energy_shaping.controller import EnergyShaping
from hopping_leg.errors import UsageError
from hopping_leg.robot import NO_MISMATCH, Latency, Robot, load_robot, parent_robot, shipped_robots
from hopping_leg.sim import NO_NOISE, NoiseAndDelay
from hopping_leg.sim.randomization import TWIN_RANGES, Range, draw_twin

LEAST_TWINS = 20
"""Twins that an interval over twins needs: with fewer a bootstrap interval is too narrow."""


@dataclass(frozen=True)
class Twin:
    """A leg that plays the real one.

    Attributes:
        name: In results and file names.
        source: Shipped name or path of its robot file.
        believed: Robot that it extends: all that is known of it without a recording.
    """

    name: str
    source: str
    believed: str

    @property
    def robot(self) -> Robot:
        """The twin itself."""
        return load_robot(self.source)


def drawn_twin(seed: int, folder: Path, friction: float = 0.0, hip_gain: float = 1.0) -> Twin:
    """Return a twin that is drawn at random; its robot file is written to a folder.

    Its joints have so much more ``friction``, N m, than usual, and so many times the hip's gain.
    """

    def harder(usual: Range) -> Range:
        more = friction * (usual.path in ("hip.friction", "knee.friction"))
        factor = hip_gain if usual.path == "reality.hip.torque_gain" else 1.0
        return replace(usual, low=usual.low * factor + more, high=usual.high * factor + more)

    twin = draw_twin(seed, ranges=list(map(harder, TWIN_RANGES)))
    path = folder / f"{twin.robot.name}.toml"
    if not path.exists() or load_robot(path) != twin.robot:
        twin.save(path)
    return Twin(twin.robot.name, str(path), str(twin.tree["extends"]))


def given_twin(word: str) -> Twin:
    """Return a shipped robot, or one of a file, as a twin; UsageError if it extends no robot."""
    robot = load_robot(word)
    robot.require_leg()
    parent = parent_robot(word)
    if parent is None:
        raise UsageError(
            f"{word} extends no robot, so that nothing says what is believed of it before it is"
            " identified; let its file extend one, e.g. legv2."
        )
    return Twin(robot.name, word if word in shipped_robots() else str(Path(word)), parent)


def find_twins(words: Sequence[str], folder: Path) -> tuple[Twin, ...]:
    """Return twins that were asked for; drawn ones are written to a folder.

    A single number draws so many twins, with seeds 0, 1, ...; other words are shipped robots or
    robot files. UsageError says that there is none, or that two share a name.
    """
    if len(words) == 1 and words[0].isdigit():
        found = tuple(drawn_twin(seed, folder) for seed in range(int(words[0])))
    else:
        found = tuple(given_twin(word) for word in words)
    if not found or len({twin.name for twin in found}) < len(found):
        raise UsageError(
            "--twins needs a number of 1 or more, or robot files with different names."
        )
    return found


BELT = (resources.files("hopping_leg.identify") / "with_belt.toml").read_text(encoding="utf-8")
"""A robot file that extends another one by what is assumed of its knee's belt."""

_KNEE = tomllib.loads(BELT.format("legv2"))["reality"]["knee"]
PLAY: dict[str, Any] = {name: number["value"] for name, number in _KNEE.items()}
"""What is assumed of the belt, SI."""
_JITTER = 5e-4  # of commands, s, assumed with it

Noise = Literal["own", "on", "off"]
"""The paper's noise and delay in trials: ``own`` where a leg brings none itself."""


def with_play(robot: Robot) -> Robot:
    """Return a robot with what is assumed of its belt."""
    knee = replace(robot.reality.knee, **PLAY)
    return replace(robot, reality=replace(robot.reality, knee=knee))


def simulated(source: str, *, belt: bool = False) -> Robot:
    """Return a robot as training simulates it: with the loop's delay, and a belt if asked."""
    robot = load_robot(source)
    latency = Latency(command=robot.reality.latency.command, jitter=_JITTER if belt else 0.0)
    known = robot.reality.in_training if belt else NO_MISMATCH
    robot = replace(robot, reality=replace(known, latency=latency))
    return with_play(robot) if belt else robot


def disturbance_of(robot: Robot, noise: Noise = "own") -> NoiseAndDelay:
    """Return what a leg is tried with on top of what it brings: nothing, if it brings anything."""
    noisy = robot.reality == NO_MISMATCH if noise == "own" else noise == "on"
    return NoiseAndDelay() if noisy else NO_NOISE


def fingerprint(controller: Controller) -> str:
    """Return what distinguishes a controller from others of its name, as far as is known."""
    if isinstance(controller, EnergyShaping):
        return f"{type(controller).__name__}({controller.gains})"
    named = f"{type(controller).__module__}.{type(controller).__qualname__}"
    return str(getattr(controller, "digest", named))
