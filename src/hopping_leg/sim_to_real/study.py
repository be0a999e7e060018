"""What a transfer study was asked for, and where it keeps its files."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hopping_leg.errors import UsageError
from hopping_leg.identify.optimizers import LeastSquaresOptions
from hopping_leg.robot import NO_MISMATCH, Latency, Robot, load_robot, parent_robot, shipped_robots
from hopping_leg.sim.randomization import draw_twin
from hopping_leg.sim_to_real.methods import Method

SHORTEST = 30.0
"""Shortest recording, s: one swing of the leg per amplitude."""

USUAL_FIT = LeastSquaresOptions(tolerance=1e-3)
"""A round that lowers the cost by a smaller share ends the search."""


@dataclass(frozen=True)
class TwinFile:
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

    @property
    def without_surprises(self) -> Robot:
        """The twin as the simulator for training could know it at best."""
        robot = self.robot
        latency = Latency(command=robot.reality.latency.command)
        known = replace(NO_MISMATCH, latency=latency)
        return replace(robot, name=f"{self.name}-truth", reality=known)


@dataclass(frozen=True)
class Study:
    """Options and folder of a study."""

    folder: Path
    twins: tuple[TwinFile, ...]
    methods: tuple[Method, ...]
    seeds: tuple[int, ...] = (0,)
    """Seeds of the trainings, one each."""
    recipe: str = "fast"
    """Recipe by which policies are trained."""
    changes: tuple[str, ...] = ()
    """Numbers of the recipe that differ from its defaults, each ``name=number``."""
    steps: int = 1_200_000
    """Control steps of experience of a training."""
    seconds: float = 60.0
    """Duration of each recording, s."""
    generations: int = 100
    """Generations of CMA-ES in each pass, for the methods that use it."""
    least_squares: LeastSquaresOptions = USUAL_FIT
    """How far the methods that use it search."""
    commands: tuple[float, ...] = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)
    """Apex heights at which the twins are tried, m."""
    repeats: int = 3
    """Runs of 15 s at each command."""
    effects: bool = False
    """Whether the first method's policies also meet the twins with one effect less at a time."""
    threads: int = 1
    """Threads of a training or trial; a fit takes every core."""

    def __post_init__(self) -> None:
        for name in ("steps", "generations", "repeats", "threads"):
            if getattr(self, name) < 1:
                raise UsageError(f"'{name}' is {getattr(self, name)} but must be at least 1.")
        if not SHORTEST <= self.seconds < float("inf"):
            raise UsageError(
                f"Recordings of {self.seconds:g} s are too short; give at least {SHORTEST:g} s."
            )
        if not self.seeds or min(self.seeds) < 0 or len(set(self.seeds)) < len(self.seeds):
            raise UsageError(f"Training seeds {self.seeds} must be 0 or more, each given once.")

    def recording(self, twin: TwinFile, rig: str) -> Path:
        """Return the file of a recording of a twin on a rig."""
        return self.folder / "recordings" / f"{twin.name}-{rig}.parquet"

    def simulated(self, twin: TwinFile, method: Method) -> Robot:
        """Return what a method believes a twin to be; what it fits must be there.

        Raises:
            RobotError: The fit is missing.
        """
        if method.truth:
            return twin.without_surprises
        if method.fit is not None:
            return load_robot(self.fitted(twin, method))
        return replace(load_robot(method.robot or twin.believed), reality=NO_MISMATCH)

    def fitted(self, twin: TwinFile, method: Method) -> Path:
        """Return the robot file that a method fits; beside it, as .json, stands the fit."""
        assert method.fit is not None
        return self.folder / "robots" / f"{twin.name}-{method.fit.name}.toml"

    def training(self, twin: TwinFile, method: Method, seed: int) -> Path:
        """Return a training's folder; what does not depend on the twin is trained once."""
        name = f"{twin.name}-{method.name}"
        if not method.of_twin:
            name = Path(method.robot or twin.believed).stem
            name += f"-{method.ranges}" if method.randomised else ""
        return self.folder / "training" / f"{name}-seed{seed}"

    def trial(self, twin: TwinFile, method: Method, seed: int) -> Path:
        """Return the file with how a policy hopped on a twin."""
        return self.folder / "trials" / f"{twin.name}-{method.name}-seed{seed}.json"


def find_twins(words: Sequence[str], folder: Path) -> tuple[TwinFile, ...]:
    """Return twins that were asked for; drawn ones are written to a folder.

    A single number draws so many twins, with seeds 0, 1, ...; other words are shipped robots or
    robot files.

    Raises:
        UsageError: The number is not positive, or two twins share a name.
        RobotError: There is no such robot.
    """
    if len(words) == 1 and words[0].lstrip("+-").isdigit():
        count = int(words[0])
        if count < 1:
            raise UsageError(f"{count} twins are too few; give 1 or more.")
        return tuple(_drawn(seed, folder) for seed in range(count))
    found = tuple(_given(word) for word in words)
    names = [twin.name for twin in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice or not found:
        reason = f"Two twins are called '{twice[0]}'" if twice else "No twin was named"
        raise UsageError(f"{reason}; give a number, or robot files with different names.")
    return found


def _drawn(seed: int, folder: Path) -> TwinFile:
    twin = draw_twin(seed)
    path = folder / f"{twin.robot.name}.toml"
    if not path.exists() or load_robot(path) != twin.robot:
        twin.save(path)
    return TwinFile(twin.robot.name, str(path), str(twin.tree["extends"]))


def _given(word: str) -> TwinFile:
    robot = load_robot(word)
    robot.require_leg()
    parent = parent_robot(word)
    if parent is None:
        raise UsageError(
            f"{word} extends no robot, so that nothing says what is believed of it before it is"
            " identified; let its file extend one, e.g. legv2."
        )
    return TwinFile(robot.name, word if word in shipped_robots() else str(Path(word)), parent)
