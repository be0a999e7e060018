"""Whether recordings say what moved the leg; without that there is nothing to simulate."""

from collections.abc import Sequence

from hopping_leg.errors import RecordingError
from hopping_leg.identify.columns import PAIRS
from hopping_leg.identify.recording import Recording


def check_commands(recordings: Sequence[Recording]) -> None:
    """Refuse recordings without the commands that their rig was driven by.

    Raises:
        RecordingError: Naming file and columns.
    """
    for recording in recordings:
        torques = recording.metadata.onboard == "torque"
        wanted = "torque_command" if torques else "position_command"
        if not recording.has(wanted):
            what = "commanded torques" if torques else "targets of its on-board PD"
            raise RecordingError(
                f"{recording.name} has no {what} ({', '.join(PAIRS[wanted])}), so that nothing says"
                " what moved the leg; record them."
            )
