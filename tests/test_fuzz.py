"""No mutated file ends in anything but one sentence, in bounded time and memory.

A kind of file is tried in a process of its own: ``python -m tests.test_fuzz KIND COUNT``.
HOPPING_LEG_FUZZ says how many are tried.
"""

import gzip
import io
import json
import os
import re
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import zlib
from importlib import resources
from pathlib import Path

import numpy as np
import onnx
import polars as pl
import pytest

from hopping_leg.controllers.energy_shaping.gains import load_gains
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_policy
from hopping_leg.deploy.flight_recorder import FlightRecorder
from hopping_leg.emulator.faults import load_faults
from hopping_leg.errors import HoppingLegError
from hopping_leg.evaluate import metrics, trials
from hopping_leg.flight_recording import MAGIC, frame, recover
from hopping_leg.identify.excitation import Multisine, load_excitation, make_excitation
from hopping_leg.identify.recording import load_recording
from hopping_leg.robot import build_model, get_spec, load_robot, to_urdf
from hopping_leg.robot.importing import imported_robot
from hopping_leg.robot.planar_leg import read_leg
from hopping_leg.robot.robot_files import robot_from_tree
from hopping_leg.trace import Trace
from tests.doc_pages import blocks
from tests.identify.runs import SIDECAR, rig_log, swinging

COUNT = int(os.environ.get("HOPPING_LEG_FUZZ", "200"))  # Files of each kind

MEMORY = 3 << 30  # Most that reading a file may take, bytes: a table's 2 GiB, and the program's
SECONDS = 60
LONGEST = 1500  # Characters of a sentence

NUMBER = re.compile(rb"-?\d+(\.\d+)?([eE][-+]?\d+)?")
WORD = re.compile(rb'"[^"]*"|[A-Za-z_]\w*')
STRANGE = (
    b"0", b"-1", b"1e308", b"1e999", b"nan", b"NaN", b"inf", b"-inf", b"null", b"true", b'""', b"x",
    b"[]", b"{}", b"[1, 2]", b'{"a": 1}', b"9" * 400, b"9" * 5000, b"[" * 3000, b'"\xc3\xa4\xff"',
    b"'''", b"1979-05-27", b"\x00", b'"[red]:smile:"', b"2e9", b"1e-320",
)  # fmt: skip


def mutate(content: bytes, rng: np.random.Generator, *, text: bool) -> bytes:
    """Return a content with one to four changes."""
    data = bytearray(content)
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        at, length = int(rng.integers(len(data) + 1)), int(rng.integers(1, 64))
        other = int(rng.integers(len(data) + 1))
        match int(rng.integers(12 if text else 6)):
            case 0 if data:
                data[at % len(data)] ^= 1 << int(rng.integers(8))
            case 1:
                del data[at : at + length]
            case 2:
                data[at:at] = data[other : other + length]
            case 3:
                data[at : at + length] = rng.bytes(length)
            case 4:
                del data[at:]
            case 5:
                extreme = struct.pack("<q", int(rng.choice([0, -1, 2**31 - 1, 2**62, 1 << 20])))
                data[at : at + 8] = extreme[: int(rng.choice([1, 4, 8]))]
            case _:
                found = list((NUMBER if rng.integers(2) else WORD).finditer(data))
                if found:
                    start, end = found[int(rng.integers(len(found)))].span()
                    data[start:end] = STRANGE[int(rng.integers(len(STRANGE)))]
    return bytes(data)


def written(write):
    """Return the files that a function writes into a folder."""
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder))
        found = sorted(file for file in Path(folder).rglob("*") if file.is_file())
        return {str(file.relative_to(folder)): file.read_bytes() for file in found}


def readable(header):
    return header.decode("latin-1").replace("\0", " ")


def description(form):
    def read(path):
        tree, _ = imported_robot(read_leg(path), path.name, ("qdd100",))
        build_model(robot_from_tree(tree, path.name))

    leg = load_robot("legv2")
    spec = get_spec(leg)
    spec.compile()
    text = to_urdf(leg) if form == "urdf" else spec.to_xml()
    return read, {"leg.xml": text.encode()}


PACKAGE = resources.files("hopping_leg")
TWIN = (PACKAGE / "robot/robots/twin.toml").read_bytes()
GAINS = (PACKAGE / "controllers/gains/energy-shaping.toml").read_bytes()
(FAULTS,) = (block.text.encode() for block in blocks("emulator") if "[[fault]]" in block.text)
FAULTS += b'[[fault]]\nkind = "configuration"\nname = "servo.max_current_A"\nvalue = 20.0\n'
SIDE, TABLE = SIDECAR.encode(), swinging(80)
CSV, RIG = TABLE.write_csv().encode(), rig_log(rows=80).write_csv().encode()
PACKED = gzip.compress(CSV)


def sidecar():
    files = {"run.toml": SIDE, "run.csv": CSV}
    return lambda path: load_recording(path.with_name("run.csv")), files


def mcap():
    from hopping_leg.formats import to_mcap

    return load_recording, {"run.mcap": to_mcap(Trace(TABLE)), "run.toml": SIDE}


def header(table, content, read):
    """Return a Parquet file whose header is mutated."""

    def seal(content):
        file = io.BytesIO()
        table.write_parquet(file, metadata={"hopping_leg": readable(content)})
        return file.getvalue()

    return read, {"run.parquet": content}, seal


def recording():
    about = {"rig": "fixed-base", "rate_hz": 200.0, "robot": "legv2", "source": "made up"}
    tree = {"schema": 1, "events": [], "recording": about}
    return header(TABLE, json.dumps(tree).encode(), load_recording)


def excitation():
    made = make_excitation(Multisine(duration=12.0), load_robot("legv2"))
    ((_, content),) = written(lambda folder: made.save(folder / "run.parquet")).items()
    told = pl.read_parquet_metadata(io.BytesIO(content))["hopping_leg"].encode()
    return header(pl.read_parquet(io.BytesIO(content)), told, load_excitation)


def flight():
    def write(folder):
        box = FlightRecorder(folder / "run.blackbox", ("time_s", "command_m"), {"robot": "legv2"})
        for tick in range(9):
            box.row([float(tick), 0.3])
        box.event(state="damping")
        box.close()

    return lambda path: metrics.measure(trials.load_run(path).trace), written(write)


def frames():
    """Return a flight recording whose frames are cut from a content, with checksums that fit."""

    def seal(data):
        parts = data.split(b"\n\n")
        kinds = [int(part[:1]) % 4 if part[:1].isdigit() else 0 for part in parts]
        return MAGIC + b"".join(frame(k, p[1:]) for k, p in zip(kinds, parts, strict=True))

    first = b'0{"columns": ["time_s", "command_m"], "header": {"robot": "legv2"}}'
    row = b"1" + struct.pack("<2d", 1, 2)
    content = b"\n\n".join([first, row, b'2{"state": "damping"}', row])
    return recover, {"run.blackbox": content}, seal


def checkpoint():
    from hopping_leg.rl.checkpoint import read_checkpoint, write_checkpoint

    tree = {"weights": np.arange(60.0).reshape(3, 20), "steps": 7, "names": ["a", {"b": np.eye(2)}]}
    return read_checkpoint, written(lambda folder: write_checkpoint(folder, 7, tree))


def card():
    policy = load_policy("fast")

    def seal(content):
        model = onnx.load_from_string(policy.content)
        model.metadata_props[0].value = readable(content)
        return model.SerializeToString()

    return Policy.load, {"policy.onnx": policy.card.to_json().encode()}, seal


KINDS = {
    "robot": lambda: (lambda path: build_model(load_robot(path)), {"leg.toml": TWIN}),
    "description-urdf": lambda: description("urdf"),
    "description-mjcf": lambda: description("mjcf"),
    "gains": lambda: (load_gains, {"gains.toml": GAINS}),
    "faults": lambda: (load_faults, {"faults.toml": FAULTS}),
    "recording-csv": lambda: (load_recording, {"run.csv": CSV, "run.toml": SIDE}),
    "recording-rig": lambda: (load_recording, {"log.csv": rig_log(rows=80).write_csv().encode()}),
    "recording-gzip": lambda: (load_recording, {"run.csv.gz": PACKED, "run.toml": SIDE}),
    "recording-sidecar": sidecar,
    "bag-mcap": mcap,
    "trace-header": recording,
    "trace-raw": lambda: (Trace.load, written(lambda f: Trace(TABLE).save(f / "run.parquet"))),
    "trace-excitation": excitation,
    "flight-recorder-raw": flight,
    "flight-recorder-framed": frames,
    "checkpoint": checkpoint,
    "policy-raw": lambda: (Policy.load, {"policy.onnx": load_policy("fast").content}),
    "policy-card": card,
}
"""What makes each kind: what reads it, and its files, of which the first is mutated.

Where a third part follows, it makes that file from the mutated content, e.g. with a checksum that
fits."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_mutated_file_ends_in_anything_but_a_sentence(kind):
    words = [sys.executable, "-m", "tests.test_fuzz", kind, str(COUNT)]
    done = subprocess.run(words, capture_output=True, text=True, errors="replace")
    assert done.returncode == 0, f"{done.stdout[-20:]}: {done.stderr[-3000:]}"


def main(name, count):
    """Try seeds; the last one that is printed ended in something else, or took too long."""
    read, files, *seal = KINDS[name]()
    changed, whole = next(iter(files.items()))
    text = bool(seal) or changed.endswith((".toml", ".csv", ".xml"))

    def told(content):
        """Return what is said of a content, which ends well or in sentences."""
        with tempfile.TemporaryDirectory() as folder:
            for file, data in {**files, changed: seal[0](content) if seal else content}.items():
                path = Path(folder) / file
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(data)
            return getattr(read(Path(folder) / changed), "warnings", ())

    told(whole)  # what is not mutated is read
    for seed in range(count):
        print(seed, flush=True)
        rng = np.random.default_rng((zlib.crc32(name.encode()), seed))
        signal.alarm(SECONDS)
        try:
            sentences = told(mutate(whole, rng, text=text))
        except HoppingLegError as error:
            sentences = [str(error)]
        signal.alarm(0)
        for said in sentences:
            assert said.endswith((".", "?")), said
            assert "\n" not in said
            assert len(said) <= LONGEST
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 < MEMORY


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
