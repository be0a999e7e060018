"""The trace of motors that tracked an excitation, as a recording."""

import numpy as np
import polars as pl

from hopping_leg.controllers.joint_pd import JointGains
from hopping_leg.errors import RecordingError
from hopping_leg.identify.columns import MEASURED, PAIRS
from hopping_leg.identify.excitation import Excitation
from hopping_leg.identify.recording import Recording, make_recording
from hopping_leg.identify.recording_format import RecordingMetadata
from hopping_leg.trace import Trace


def recording_of(
    trace: Trace, excitation: Excitation, *, believed: str, gains: JointGains, name: str
) -> Recording:
    """Return the part of a run in which the excitation was played.

    Each row holds what the drives reported when the command of the row was computed; ticks without
    a reply have no measurement. The joint PD runs on the host, once per row.

    Args:
        trace: Of the run, with the targets of the PD in its columns.
        excitation: That was played.
        believed: Robot file that the recording is filed under, where identification begins.
        gains: Of the PD.
        name: Of the recording, for messages.

    Raises:
        RecordingError: The excitation was not played, or the recording cannot be believed.
    """
    targets = PAIRS["position_command"] + PAIRS["velocity_command"]
    lacking = [column for column in (*MEASURED, *targets) if column not in trace.table.columns]
    if lacking:
        raise RecordingError(f"{name} has no column '{lacking[0]}'; no excitation was played.")
    table = trace.table.filter(pl.col(targets[0]).is_finite())
    if not table.height:
        raise RecordingError(f"{name} ended before the excitation began; see its events.")
    first = float(table["time_s"][0])
    time = np.round(table["time_s"].to_numpy() - first, 9)
    columns = [table[column] for column in (*MEASURED, *targets)]
    metadata = RecordingMetadata(
        rig=excitation.rig,
        rate_hz=excitation.rate,
        robot=believed,
        source=f"motors on {trace.header.get('transport')}, {trace.header.get('started')}",
        onboard="zoh",
        stiffness=gains.stiffness,
        damping=gains.damping,
    )
    facts = {
        "excitation": excitation.description,
        "excitation_digest": excitation.digest,
        "run": {k: v for k, v in trace.header.items() if k != "events"},
    }
    return make_recording(
        pl.DataFrame([pl.Series("time_s", time), *columns]), metadata, name, header=facts
    )
