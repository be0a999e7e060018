"""Recordings belong to their twin."""

import dataclasses

import polars as pl
import pytest

from hopping_leg.errors import UsageError
from hopping_leg.sim_to_real.recording import Record
from hopping_leg.trace import Trace
from tests.sim_to_real.studies import study


def test_a_recording_belongs_to_its_twin_and_time(tmp_path):
    one = study(tmp_path)
    job = Record(one, one.twins[0], "rail")
    header = {"robot_digest": one.twins[0].robot.digest, "seconds": 60.0}
    Trace(pl.DataFrame({"time_s": [0.0]}), header).save(job._file)
    assert job.done
    longer = dataclasses.replace(job, study=dataclasses.replace(one, seconds=90.0))
    stranger = dataclasses.replace(job, twin=one.twins[1])
    stranger._file.write_bytes(job._file.read_bytes())
    for other in (longer, stranger):
        with pytest.raises(UsageError, match="another twin or for another time"):
            assert other.done
