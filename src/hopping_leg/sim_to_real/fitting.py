"""Second stage: identify the twin from its recordings, knowing only the robot that it extends."""

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hopping_leg.errors import UsageError
from hopping_leg.identify.cost import Scoring
from hopping_leg.identify.optimizers import CmaOptions
from hopping_leg.identify.parameters import LegHypothesis
from hopping_leg.identify.pipeline import IdentifyOptions, identify
from hopping_leg.identify.plan import make_plan
from hopping_leg.identify.recording import load_recording
from hopping_leg.identify.result import Identified, as_json, save_robot
from hopping_leg.identify.search import SearchOptions
from hopping_leg.io import write_json
from hopping_leg.robot import load_robot
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim_to_real.methods import Fit, Method
from hopping_leg.sim_to_real.study import USUAL_FIT, Study, TwinFile

_INERTIA_FACTOR = 10.0
"""How far off the CAD's link inertias may be: the paper's Table I has nine times the shank's."""


@dataclass(frozen=True)
class Identify:
    """A twin identified by a method."""

    study: Study
    twin: TwinFile
    method: Method

    @property
    def weight(self) -> float:
        """Rough time, min."""
        return 10.0 if self.study.least_squares == USUAL_FIT else 1.0

    @property
    def name(self) -> str:
        """What is done."""
        return f"identify {self.twin.name}, {self.fit.name}"

    @property
    def fit(self) -> Fit:
        """How."""
        assert self.method.fit is not None
        return self.method.fit

    @property
    def done(self) -> bool:
        """Whether the robot file is there.

        Raises:
            UsageError: It is there, but from other recordings.
        """
        file = self.study.fitted(self.twin, self.method)
        if not file.exists():
            return False
        asked = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))["asked"]
        if asked != self._asked():
            raise UsageError(
                f"{file} was identified from other recordings or with other options; give another"
                " --folder, or delete it to identify again."
            )
        return True

    def run(self, *, quiet: bool) -> None:
        """Identify and write the robot file; a fit that was killed goes on."""
        study, search = self.study, self.fit.search
        file = study.fitted(self.twin, self.method)
        believed = load_robot(self.twin.believed)
        effort = SearchOptions(
            cma=CmaOptions(generations=study.generations),
            least_squares=study.least_squares,
        )
        recordings = [load_recording(path) for path in self._recordings]
        options = IdentifyOptions(search=search, bounds=_bounds(believed), effort=effort)
        if search == "one-pass":
            names = make_plan(recordings, believed, search="two-pass").parameters.names
            options = dataclasses.replace(
                options, search="cma", parameters=tuple(names), scoring=Scoring()
            )
        identified = identify(
            recordings,
            believed,
            options=options,
            folder=file.with_suffix(""),
            resume=True,
        )
        content = {"asked": self._asked(), **as_json(identified), "truth": self._truth(identified)}
        write_json(file.with_suffix(".json"), content)
        save_robot(identified, file, self.twin.believed)

    def progress(self) -> tuple[float, str]:
        """Return the share done and what to show while it runs."""
        return 0.0, ""

    @property
    def _recordings(self) -> list[Path]:
        return [self.study.recording(self.twin, rig) for rig in self.fit.rigs]

    def _asked(self) -> dict[str, Any]:
        search = self.fit.search
        effort = self.study.least_squares
        return {
            "recordings": [load_recording(path).digest for path in self._recordings],
            "search": search,
            "generations": None if search == "least-squares" else self.study.generations,
            **({} if effort == USUAL_FIT else {"least_squares": dataclasses.asdict(effort)}),
        }

    def _truth(self, identified: Identified) -> dict[str, float]:
        """Return the twin's own values of what was fitted, where it has them."""
        truth = LegHypothesis(self.twin.without_surprises)
        names = identified.parameters.names
        values = {name: truth.get(name) for name in names if not name.startswith("drive.")}
        if "drive.delay" in names:
            values["drive.delay"] = self.twin.robot.reality.latency.command
        return values


def _bounds(believed: Robot) -> dict[str, tuple[float, float]]:
    links = {"thigh.inertia": believed.thigh.inertia, "shank.inertia": believed.shank.inertia}
    return {name: (v / _INERTIA_FACTOR, v * _INERTIA_FACTOR) for name, v in links.items()}
