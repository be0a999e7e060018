"""Rerun recordings hold every number of a trace, and the leg."""

import numpy as np
import pytest

from hopping_leg.robot import load_robot
from tests.formats.traces import noise

pytest.importorskip("rerun", reason="the extra 'rerun' is not installed")
from hopping_leg.formats import rerun_writer


def stored(path):
    """Return what a file holds by entity: times in ns and values."""
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        names = [n for n in batch.schema.names if n.endswith((":scalars", ":strips"))]
        if names and "time" in batch.schema.names:
            times, values = batch.column("time").cast("int64"), batch.column(names[0])
            before = found.get(chunk.entity_path, ([], []))
            found[chunk.entity_path] = (
                before[0] + times.to_pylist(),
                before[1] + values.to_pylist(),
            )
    return found


def test_numbers_and_times_are_those_of_the_trace(tmp_path):
    trace, path = noise(), tmp_path / "run.rrd"
    rerun_writer.write_rerun(trace, load_robot("legv2"), path)
    found = stored(path)
    for name in trace.numbers:
        times, values = found[f"/{name}"]
        assert times == [5_000_000 * k for k in range(40)]
        assert [value for (value,) in values] == trace.column(name).tolist()
    assert len(found[f"/{rerun_writer.LEG}"][1]) == 40
    rerun_writer.write_rerun(trace, None, path)
    assert f"/{rerun_writer.LEG}" not in stored(path)


def test_links_have_their_lengths_and_hang_from_the_base():
    trace, robot = noise(), load_robot("legv2")
    points = rerun_writer.links(trace, robot)
    np.testing.assert_array_equal(points[:, 0, 2], trace.column("height_m"))
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=-1)
    np.testing.assert_allclose(lengths, [[robot.thigh.length, robot.shank.length]] * 40)
