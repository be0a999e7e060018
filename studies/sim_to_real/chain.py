"""The chain of a study, stage by stage, for many twins and methods; results stay in a folder."""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hopping_leg.cli.options import Heights, JsonFile, at_least
from hopping_leg.controllers.energy_shaping.gains import load_gains
from hopping_leg.evaluate import runner
from hopping_leg.rl.recipes import get_recipe, randomise
from hopping_leg.robot import load_robot
from hopping_leg.sim import NO_NOISE
from studies.shared import Row, do_all
from studies.sim_to_real import steps
from studies.sim_to_real.methods import DEFAULT, Method, choose_methods
from studies.sim_to_real.twins import (
    LEAST_TWINS,
    PLAY,
    Noise,
    Twin,
    disturbance_of,
    find_twins,
    fingerprint,
    simulated,
)


@dataclass(frozen=True)
class Experiment:
    """What is compared on which twins, and where it is kept."""

    twins: tuple[str, ...] = (str(LEAST_TWINS),)
    """How many twins to draw, or robot files that extend what is believed of them; intervals over
    twins need 20."""
    methods: tuple[str, ...] = DEFAULT
    """What policies are trained on, the others being compared with the first. Valid: identified,
    identified-belt, two-pass, cad, table-1, truth, randomised, whose legs differ in training; and,
    not trained, energy-shaping-identified. energy-shaping and energy-shaping-tuned hop beside
    them."""
    seeds: tuple[int, ...] = (0,)
    """Seeds of the trainings, one of each method and twin each."""
    recipe: str = "fast"
    """Recipe by which policies are trained, as in `hop train`."""
    steps: int = 300_000
    """Control steps of experience of a training."""
    seconds: float = 60.0
    """Duration of each recording, s; the paper's are 240 s, a swing per amplitude takes 30 s."""
    commands: Heights = (0.25, 0.27, 0.29, 0.31, 0.33, 0.35)
    """Apex heights at which the twins are tried, m."""
    repeats: int = 3
    """Runs of 15 s at each command."""
    disturbance: Noise = "own"
    """The paper's noise and delay in trials: ``own`` where a twin brings none itself."""
    jobs: int = 1
    """Recordings, fits, trainings or trials at the same time, each in its own process."""
    folder: Path = Path("runs/transfer")
    """Folder for recordings, robots, trainings and trials; what is there is not done again."""
    json: JsonFile = None


class Chain:
    """Twins and methods of an experiment; each stage does what is not done yet.

    UsageError says that an option has no meaning, RobotError that there is no such twin.
    """

    def __init__(self, asked: Experiment) -> None:
        at_least(1, jobs=asked.jobs, steps=asked.steps)
        at_least(1, repeats=asked.repeats, seeds=len(asked.seeds))
        at_least(30, seconds=round(asked.seconds))
        get_recipe(asked.recipe)
        self.asked, self.methods = asked, choose_methods(asked.methods)
        self.twins = find_twins(asked.twins, asked.folder / "twins")

    def about(self) -> Row:
        """Return what results begin with: the twins and how they were met."""
        return {
            "twins": [
                {
                    "name": twin.name,
                    "robot_digest": twin.robot.digest,
                    "believed": twin.believed,
                    "paper_disturbance": disturbance_of(twin.robot, self.asked.disturbance)
                    != NO_NOISE,
                }
                for twin in self.twins
            ],
            "recording_seconds": self.asked.seconds,
            "evaluation_seed": steps.FIRST_SEED,
            "evaluation_seeds": self.asked.repeats,
            "versions": runner.software_versions(),
        }

    def source(self, twin: Twin, method: Method) -> str:
        """Return the robot that a method simulates for a twin: its name or file."""
        if method.truth:
            return twin.source
        if method.fit:
            return str(self._fit(twin, method))
        return method.robot or twin.believed

    def identify(self) -> list[Row]:
        """Record the twins and identify them, if a method asks for it; return the fits."""
        kinds = {method.fit: method for method in self.methods if method.fit}
        if not kinds:
            return []
        seconds = self.asked.seconds
        files = {
            (twin, rig): self._file("recordings", f"{twin.name}-{rig}.parquet")
            for twin in self.twins
            for rig in steps.RIGS
        }
        recorded = do_all(
            (
                (file.with_suffix(".json"), {"twin": twin.robot.digest, "seconds": seconds},
                 steps.record, twin, rig, seconds, file)
                for (twin, rig), file in files.items()
            ),
            self.asked.jobs,
        )  # fmt: skip
        digests = {key: row["digest"] for key, row in zip(files, recorded, strict=True)}
        jobs = []
        for twin, method in ((t, m) for t in self.twins for m in kinds.values()):
            pair = [(twin, rig) for rig in steps.RIGS]
            asked = {
                "believed": load_robot(twin.believed).digest,
                "recordings": [digests[key] for key in pair],
                **({"belt": PLAY} if method.belt else {}),
                **({"search": method.search} if method.search != "least-squares" else {}),
            }
            file, recordings = self._fit(twin, method), [files[key] for key in pair]
            fit = twin, recordings, file, method.search, method.belt
            jobs.append((file.with_suffix(".json"), asked, steps.fit, *fit))
        return do_all(jobs, self.asked.jobs)

    def train(self) -> list[Row]:
        """Train all policies and tune all gains; return the trainings."""
        tuned = [(twin, method) for method in self.methods if method.tuned for twin in self.twins]
        do_all((self._tuning(*pair) for pair in tuned), self.asked.jobs)
        every = [self._training(*job) for job in self._runs() if not job[1].untrained]
        return do_all({job[0]: job for job in every}.values(), self.asked.jobs)

    def _runs(self) -> list[tuple[Twin, Method, int]]:
        """Return every trial; what is not trained has one for each twin."""
        first = self.asked.seeds[0]
        every = ((t, m, s) for s in self.asked.seeds for m in self.methods for t in self.twins)
        return [(t, m, s) for t, m, s in every if s == first or not m.untrained]

    def _training(self, twin: Twin, method: Method, seed: int) -> tuple[Any, ...]:
        """Return the job of a training; what does not depend on the twin is trained once."""
        source = self.source(twin, method)
        recipe = get_recipe(self.asked.recipe).replace({"steps": self.asked.steps})
        recipe = randomise(recipe, method.ranges)
        robot = simulated(source, belt=method.belt)
        asked = {"recipe": repr(recipe), "robot": robot.digest, "seed": seed}
        name = f"{twin.name}-{method.name}"
        if not method.fit and not method.truth:
            name = Path(source).stem + ("" if method.ranges == "none" else f"-{method.ranges}")
        mark = hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:8]
        folder = self._file("training", f"{name}-seed{seed}-{mark}")
        return (folder.with_name(f"{folder.name}.json"), asked, steps.learn, recipe, robot, seed,
                folder)  # fmt: skip

    def _tuning(self, twin: Twin, method: Method) -> tuple[Any, ...]:
        source = self.source(twin, method)
        asked = {
            "robot": load_robot(source).digest,
            "start": asdict(load_gains(steps.TUNE.start).gains),
            "search": repr(steps.TUNE),
        }
        folder = self._file("gains", f"{twin.name}-{method.name}")
        return folder.with_suffix(".json"), asked, steps.tune, source, folder

    def hop(self) -> list[Row]:
        """Let all policies hop on the twins; return a record per policy, twin and command."""
        runs, commands, repeats = self._runs(), self.asked.commands, self.asked.repeats
        jobs = []
        for twin, method, seed in runs:
            controller: str | Path = method.untrained
            if method.tuned:
                controller = self._tuning(twin, method)[-1] / "gains.toml"
            elif not method.untrained:
                controller = self._training(twin, method, seed)[-1] / "policy.onnx"
            told = self.source(twin, method) if method.untrained else twin.believed
            noise = self.asked.disturbance
            trial = f"{twin.name}-{method.name}-seed{seed}{'' if noise == 'own' else noise}"
            file = self._file("trials", f"{trial}.json")
            asked = {
                "policy": fingerprint(steps.load(controller, told)),
                "twin": twin.robot.digest,
                "commands": commands,
                "repeats": repeats,
            }
            hops = commands, repeats, noise
            jobs.append((file, asked, steps.hop, controller, told, twin, hops))
        return [
            {"method": method.name, "twin": twin.name, "seed": seed, **row}
            for (twin, method, seed), tried in zip(runs, do_all(jobs, self.asked.jobs), strict=True)
            for row in tried["rows"]
        ]

    def _fit(self, twin: Twin, method: Method) -> Path:
        return self._file("robots", f"{twin.name}-{method.fit}.toml")

    def _file(self, kind: str, name: str) -> Path:
        return self.asked.folder / kind / name
