"""Bags: what is written is read back, by us and by others, and what others write is read by us."""

import io

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hopping_leg.cli import main
from hopping_leg.errors import RecordingError, TraceError
from hopping_leg.formats import COLUMNS, FLOATS, JOINT_STATE, STATES, bag_files, read_bag
from hopping_leg.identify.recording import load_recording
from hopping_leg.robot import load_robot
from hopping_leg.trace import COLUMNS as TRACED
from hopping_leg.trace import Trace
from tests.extras import run_without
from tests.identify.runs import SIDECAR, swinging

pytest.importorskip("mcap_ros2", reason="the extra 'ros' is not installed")
from hopping_leg.formats import to_mcap

JOINTS = [c for of in COLUMNS.values() for triple in of.values() for c in triple if c]


def noise():
    """Return a trace of random numbers, all columns there."""
    rng = np.random.default_rng(0)
    columns = {name: rng.normal(size=40) for name in TRACED}
    columns |= {"time_s": np.arange(40) / 200.0, "command_m": np.full(40, 0.3)}
    header = {"robot": "legv2", "robot_digest": load_robot("legv2").digest, "rate_hz": 200.0}
    return Trace(pl.DataFrame(columns), header)


def read(path):
    return read_bag(path, str(path))


def written(folder, trace):
    path = folder / "run.mcap"
    path.write_bytes(to_mcap(trace))
    return path


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), rows=st.integers(1, 30))
def test_samples_and_times_come_back_as_they_were(seed, rows, tmp_path_factory):
    rng = np.random.default_rng(seed)
    stamps = np.cumsum(rng.integers(1, 10 ** rng.integers(1, 13), rows))
    chosen = ["hip_position_rad", *rng.choice(JOINTS, rng.integers(len(JOINTS)), replace=False)]
    strange = [0.0, -0.0, 5e-324, 1.7976931348623157e308, np.inf, -np.inf]
    values = rng.normal(size=(len(JOINTS), rows)) * 10.0 ** rng.integers(-200, 200, rows)
    values[:, 1:] = np.where(
        rng.random(rows - 1) < 0.1, rng.choice(strange, rows - 1), values[:, 1:]
    )
    table = {column: values[JOINTS.index(column)] for column in chosen}
    trace = Trace(pl.DataFrame({"time_s": stamps / 1e9, **table}), {"robot": "legv2", "seed": 3})
    back = read(written(tmp_path_factory.mktemp("bag"), trace))
    wanted = (stamps - stamps[0] // 10**9 * 10**9) / 1e9
    near = 5e-10 + 1e-16 * stamps[-1] / 1e9
    np.testing.assert_allclose(back["time_s"], wanted, rtol=0, atol=near)
    for column in table:
        np.testing.assert_array_equal(back[column], table[column])


def test_another_reader_opens_the_file_and_finds_the_same_samples(tmp_path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    trace = noise()
    content = io.BytesIO(written(tmp_path, trace).read_bytes())
    reader = make_reader(content, decoder_factories=[DecoderFactory()])
    assert reader.get_header().profile == "ros2"
    messages = [m for _, c, _, m in reader.iter_decoded_messages(topics=["/joint_states"])]
    kinds = {c.topic: s.name for s, c, _, _ in reader.iter_decoded_messages()}
    assert kinds["/joint_commands"] == JOINT_STATE
    assert kinds["/foot_clearance_m"] == "std_msgs/msg/Float64"
    assert [m.name for m in messages] == [["rail", "hip", "knee"]] * 40
    for joint, column in enumerate(["height_m", "hip_position_rad", "knee_position_rad"]):
        assert [m.position[joint] for m in messages] == trace.column(column).tolist()
    assert [m.header.stamp.nanosec for m in messages] == [5_000_000 * k for k in range(40)]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_of_ros_is_identified_from_like_any_recording(tmp_path, storage):
    path, table = tmp_path / "bag", swinging(100)
    record(path, storage, table, start=1_700_000_000)
    (tmp_path / "bag.toml").write_text(SIDECAR)
    recording = load_recording(path)
    assert len(recording) == 100
    np.testing.assert_allclose(recording.time, table["time_s"], atol=1e-9)
    for column in ("hip_position_rad", "knee_velocity_rad_s", "hip_torque_nm", "knee_command_nm"):
        np.testing.assert_array_equal(recording.trace.column(column), table[column])
    (file,) = bag_files(path)
    (tmp_path / file.with_suffix(".toml").name).write_text(SIDECAR)
    alone = file.rename(tmp_path / file.name)
    assert load_recording(alone).digest == recording.digest


def test_a_row_has_the_newest_command_that_was_logged_by_then(tmp_path):
    table = pl.DataFrame({"time_s": [0.0, 0.01, 0.02], "hip_position_rad": [1.0, 2.0, 3.0]})
    late = pl.DataFrame({"time_s": [0.005, 0.015], "hip_command_nm": [5.0, 6.0]})
    record(tmp_path / "bag", "mcap", table, late)
    assert read(tmp_path / "bag")["hip_command_nm"].to_list() == [None, 5.0, 6.0]


def test_a_sidecar_names_joints_that_are_called_otherwise(tmp_path):
    record(tmp_path / "bag", "mcap", swinging(50), topic="/leg/state", joints=("j1", "j2"))
    with pytest.raises(RecordingError, match=r"leg/state/j1\.position"):
        load_recording(tmp_path / "bag")
    names = (
        'hip_position_rad = "leg/state/j1.position"\nknee_position_rad = "leg/state/j2.position"'
    )
    (tmp_path / "bag.toml").write_text(f"{SIDECAR}[columns]\n{names}")
    found = load_recording(tmp_path / "bag").trace.column("knee_position_rad")
    np.testing.assert_array_equal(found, swinging(50)["knee_position_rad"])


def test_numbers_of_an_array_are_named_by_their_place(tmp_path):
    record(tmp_path / "bag", "mcap", swinging(40), arrays={"effort/commands": [0.5, -0.25]})
    names = 'hip_command_nm = "effort/commands[0]"\nknee_command_nm = "effort/commands[1]"'
    (tmp_path / "bag.toml").write_text(f"{SIDECAR}[columns]\n{names}")
    found = load_recording(tmp_path / "bag").array("torque_command")
    np.testing.assert_array_equal(found, np.tile([0.5, -0.25], (40, 1)))


def test_what_is_no_bag_is_said_in_a_sentence(tmp_path):
    path = written(tmp_path, noise())
    path.write_bytes(path.read_bytes()[:-500])
    with pytest.raises(RecordingError, match="no whole bag"):
        load_recording(path)
    table = pl.DataFrame({"time_s": [0.0], "command_m": [0.3]})
    with pytest.raises(RecordingError, match="no message of sensor_msgs"):
        load_recording(written(tmp_path, Trace(table)))
    with pytest.raises(TraceError, match="0 or more"):
        to_mcap(Trace(pl.DataFrame({"time_s": [-1.0]})))


def record(path, storage, *tables, start=0, topic=None, joints=("hip", "knee"), arrays=None):
    """Write tables of a recording's columns, one after another, with an independent library."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    kinds = (JOINT_STATE, "std_msgs/msg/Header", "builtin_interfaces/msg/Time", FLOATS)
    message, header, time, floats = (types.types[name] for name in kinds)
    layout = types.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()]) as bag:
        topics = {
            name: bag.add_connection(topic or f"/{name}", JOINT_STATE, typestore=types)
            for name in COLUMNS
            if topic is None or name == STATES
        }
        for name, values in (arrays or {}).items():
            raw = types.serialize_cdr(floats(layout, np.array(values)), FLOATS)
            bag.write(bag.add_connection(f"/{name}", FLOATS, typestore=types), 0, raw)
        for row in (row for table in tables for row in table.iter_rows(named=True)):
            stamp = round(1e9 * row["time_s"]) + start * 10**9
            for name, connection in topics.items():
                columns = zip(*(COLUMNS[name][joint] for joint in ("hip", "knee")), strict=True)
                arrays = [np.array([row[c] for c in of if c in row]) for of in columns]
                if count := max(map(len, arrays)):
                    head = header(time(*divmod(stamp, 10**9)), "base")
                    filled = message(head, list(joints[:count]), *arrays)
                    bag.write(connection, stamp, types.serialize_cdr(filled, JOINT_STATE))


def test_a_file_lies_beside_its_trace_or_in_a_folder(tmp_path):
    words = ["export", "traces", str(tmp_path / "run.parquet")]
    noise().save(tmp_path / "run.parquet")
    assert main(words) == main([*words, "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "run.mcap").stat().st_size > 1000
    assert (tmp_path / "out/run.mcap").exists()
    code = f"from hopping_leg.cli import main; sys.exit(main({words}))"
    assert "pip install 'hopping-leg[ros]'" in run_without(("mcap", "mcap_ros2"), code).stderr
