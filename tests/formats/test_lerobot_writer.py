"""LeRobot datasets: laid out as format v3.0 says, with the traces' numbers."""

import json

import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import TraceError
from hopping_leg.trace import Trace
from tests.formats.traces import noise

pytest.importorskip("pyarrow", reason="the extra 'lerobot' is not installed")
from pyarrow import parquet

from hopping_leg.formats.lerobot_writer import FEATURES, write_lerobot


@pytest.fixture
def traces():
    return [noise(rows=40, seed=1), noise(rows=25, seed=2), noise(rows=30, seed=3, command=0.35)]


def read(folder):
    info = json.loads((folder / "meta/info.json").read_text())
    data = pl.read_parquet(folder / info["data_path"].format(chunk_index=0, file_index=0))
    episodes = pl.read_parquet(folder / "meta/episodes/chunk-000/file-000.parquet")
    return info, data, episodes


def test_episodes_are_the_traces(traces, tmp_path):
    write_lerobot(traces, tmp_path / "set")
    info, data, episodes = read(tmp_path / "set")
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, 95, 2)
    assert info["fps"] == 200
    assert info["splits"] == {"train": "0:3"}
    assert data["index"].to_list() == list(range(95))
    for episode, trace in zip(episodes.iter_rows(named=True), traces, strict=True):
        rows = data[episode["dataset_from_index"] : episode["dataset_to_index"]]
        assert set(rows["episode_index"]) == {episode["episode_index"]}
        assert len(rows) == episode["length"] == len(trace.table)
        np.testing.assert_allclose(rows["timestamp"], trace.column("time_s"), atol=1e-6)
        for name, columns in FEATURES.items():
            assert info["features"][name]["names"] == list(columns)
            for k, column in enumerate(columns):
                wanted = trace.column(column).astype(np.float32)
                np.testing.assert_array_equal(rows[name].to_numpy()[:, k], wanted)
    assert [e["tasks"] for e in episodes.iter_rows(named=True)] == [
        ["hop to 0.3 m"], ["hop to 0.3 m"], ["hop to 0.35 m"]
    ]  # fmt: skip


def test_columns_are_what_the_features_say_and_tasks_are_an_index(traces, tmp_path):
    write_lerobot(traces, tmp_path / "set")
    info, data, episodes = read(tmp_path / "set")
    assert list(info["features"]) == data.columns
    for name, feature in info["features"].items():
        kind = {"float32": pl.Float32, "int64": pl.Int64}[feature["dtype"]]
        size = feature["shape"][0]
        assert data.schema[name] == (kind if size == 1 else pl.Array(kind, size)), name
    tasks = parquet.read_table(tmp_path / "set/meta/tasks.parquet")
    assert tasks["task_index"].to_pylist() == [0, 1]
    assert tasks.schema.pandas_metadata["index_columns"] == ["task"]
    statistics = json.loads((tmp_path / "set/meta/stats.json").read_text())
    for name, feature in info["features"].items():
        of = statistics[name]
        assert of["count"] == [95]
        for kind in ("min", "q01", "q50", "q99", "max", "mean", "std"):
            assert len(of[kind]) == feature["shape"][0]
        assert np.all(np.array(of["min"]) <= of["q50"])
        assert f"stats/{name}/mean" in episodes.columns
    mean = data["action"].to_numpy().mean(axis=0)
    np.testing.assert_allclose(statistics["action"]["mean"], mean, rtol=1e-5)


def test_another_reader_opens_the_dataset(traces, tmp_path):
    experimental = pytest.importorskip("rerun.experimental", reason="rerun is not installed")
    write_lerobot(traces, tmp_path / "set")
    reader = experimental.LeRobotReader(tmp_path / "set")
    assert reader.version == "v3"
    assert list(reader.episodes()) == [0, 1, 2]


def test_missing_values_are_those_before_and_unknown_heights_are_left_out(tmp_path):
    trace = noise()
    gap = pl.Series([None, 1.0, float("nan"), 2.0] + [3.0] * 36)
    real = Trace(
        trace.table.with_columns(gap.alias("hip_position_rad"), height_m=pl.lit(float("nan")))
    )
    write_lerobot([real], tmp_path / "set")
    info, data, _ = read(tmp_path / "set")
    assert data["observation.state"].to_numpy()[:5, 0].tolist() == [1, 1, 1, 2, 3]
    assert "observation.environment_state" not in info["features"]


@pytest.mark.parametrize(
    ("others", "said"),
    [
        ([noise(robot="legv1")], "of legv1, legv2"),
        ([noise(rate=100.0)], "at 100, 200 Hz"),
        ([Trace(noise().table.drop("command_m"), noise().header)], "no column 'command_m'"),
        ([noise(rows=1)], "must rise"),
    ],
)
def test_traces_that_make_no_dataset_are_refused(others, said, tmp_path):
    with pytest.raises(TraceError, match=said):
        write_lerobot([noise(), *others], tmp_path / "set")
    assert not (tmp_path / "set").exists()
