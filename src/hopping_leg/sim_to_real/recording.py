"""First stage: record the twin as a leg on a bench and on the rail is recorded."""

from dataclasses import dataclass
from pathlib import Path

from hopping_leg.errors import UsageError
from hopping_leg.identify.excitation import make_excitation
from hopping_leg.identify.paper_excitation import Strokes, adapt, fixed_base, moving_base
from hopping_leg.identify.play_excitation import play
from hopping_leg.identify.recording_format import Rig
from hopping_leg.robot import load_robot
from hopping_leg.sim_to_real.study import Study, TwinFile
from hopping_leg.trace import Trace

_BOTH_SWINGS = 120.0
"""Recordings of so many seconds have room for both swing periods of the paper."""


@dataclass(frozen=True)
class Record:
    """A twin recorded on a rig."""

    study: Study
    twin: TwinFile
    rig: Rig

    weight = 0.1

    @property
    def name(self) -> str:
        """What is done."""
        return f"record {self.twin.name}, {self.rig}"

    @property
    def done(self) -> bool:
        """Whether the file is there.

        Raises:
            UsageError: It is there, but of another twin or length.
        """
        if not self._file.exists():
            return False
        header = Trace.load(self._file).header
        asked = self._template().duration
        if header["robot_digest"] != self.twin.robot.digest or header["seconds"] != asked:
            raise UsageError(
                f"{self._file} was recorded from another twin or for another time; give another"
                " --folder, or delete it to record again."
            )
        return True

    def run(self, *, quiet: bool) -> None:
        """Play the paper's trajectory and write the recording."""
        believed = load_robot(self.twin.believed)
        template = adapt(self._template(), believed)
        recording = play(
            make_excitation(template, believed),
            self.twin.robot,
            believed=self.twin.believed,
            seed=0 if self.rig == "fixed-base" else 1,
        )
        recording.trace.header["seconds"] = template.duration
        recording.save(self._file)

    def progress(self) -> tuple[float, str]:
        """Return the share done and what to show while it runs."""
        return 0.0, ""

    @property
    def _file(self) -> Path:
        return self.study.recording(self.twin, self.rig)

    def _template(self) -> Strokes:
        seconds = self.study.seconds
        if self.rig != "fixed-base":
            return moving_base(duration=seconds)
        swings = (10.0, 20.0) if seconds >= _BOTH_SWINGS else (10.0,)
        return fixed_base(swings=swings, duration=seconds)
