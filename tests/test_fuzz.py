"""No mutated file ends in anything but one sentence, in bounded time and memory.

Of Parquet files that is true of the header alone: polars reads the rest. A kind of file is tried in
a process of its own, which may abort: ``python -m tests.test_fuzz KIND COUNT``.
HOPPING_LEG_FUZZ says how many are tried.
"""

import functools
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
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from hopping_leg.errors import HoppingLegError

COUNT = int(os.environ.get("HOPPING_LEG_FUZZ", "200"))
"""Files of each kind."""

MEMORY = 3 << 30
"""Most that reading a file may take, bytes: the 2 GiB of a table, and what the program needs."""

SECONDS = 60
LONGEST = 1500
"""Characters of a sentence."""

_NUMBER = re.compile(rb"-?\d+(\.\d+)?([eE][-+]?\d+)?")
_WORD = re.compile(rb'"[^"]*"|[A-Za-z_]\w*')
_STRANGE = (
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
                found = list((_NUMBER if rng.integers(2) else _WORD).finditer(data))
                if found:
                    start, end = found[int(rng.integers(len(found)))].span()
                    data[start:end] = _STRANGE[int(rng.integers(len(_STRANGE)))]
    return bytes(data)


class Kind:
    """Files in a folder of which one is mutated, and what reads them.

    ``seal`` makes the file from the mutated content, e.g. with a checksum that fits.
    """

    def __init__(self, files, name, read, *, text=True, content=None, seal=lambda data: data):
        self.files, self.name, self.read, self.text, self.seal = files, name, read, text, seal
        self.content = files[name] if content is None else content

    def write(self, folder, content):
        """Write all files, one of them from this content."""
        for name, whole in {**self.files, self.name: self.seal(content)}.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(whole)

    def try_seed(self, folder, seed):
        """Read the file of a seed, which ends well or in sentences."""
        rng = np.random.default_rng(seed)
        self.write(folder, mutate(self.content, rng, text=self.text))
        signal.alarm(SECONDS)
        try:
            sentences = getattr(self.read(folder / self.name), "warnings", ())
        except HoppingLegError as error:
            sentences = [str(error)]
        finally:
            signal.alarm(0)
        for said in sentences:
            assert said.endswith((".", "?")), said
            assert "\n" not in said
            assert len(said) <= LONGEST


def _framed(header, data):
    """Return a flight recording whose frames are cut from a content, checksums valid."""
    from hopping_leg.flight_recording import MAGIC, frame

    parts = data.split(b"\n\n")
    kinds = [int(part[:1] or b"0", 36) % 4 if part[:1].isalnum() else 0 for part in parts]
    return MAGIC + b"".join(frame(k, p[1:]) for k, p in zip(kinds, parts, strict=True))


def _with_card(content, card):
    """Return a policy with other metadata."""
    import onnx

    model = onnx.load_from_string(content)
    model.metadata_props[0].value = card.decode("latin-1").replace("\0", " ")
    return model.SerializeToString()


def _native(header, table=None):
    text = header.decode("latin-1").replace("\0", " ")
    file = io.BytesIO()
    (_table() if table is None else table).write_parquet(file, metadata={"hopping_leg": text})
    return file.getvalue()


def _table():
    from tests.identify.runs import swinging

    return swinging(80)


def _written(write):
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder))
        return {
            str(file.relative_to(folder)): file.read_bytes()
            for file in sorted(Path(folder).rglob("*"))
            if file.is_file()
        }


def _robots():
    from importlib import resources

    from hopping_leg.robot import build_model, load_robot

    def read(path):
        build_model(load_robot(path))

    twin = resources.files("hopping_leg.robot") / "robots" / "twin.toml"
    return Kind({"leg.toml": twin.read_bytes()}, "leg.toml", read)


def _descriptions(form):
    from hopping_leg.robot import build_model, get_spec, load_robot, to_urdf
    from hopping_leg.robot.importing import imported_robot
    from hopping_leg.robot.planar_leg import read_leg
    from hopping_leg.robot.robot_files import robot_from_tree

    def read(path):
        made = imported_robot(read_leg(path), path.name, ("qdd100",))
        build_model(robot_from_tree(made.tree, path.name))

    leg = load_robot("legv2")
    spec = get_spec(leg)
    spec.compile()
    text = to_urdf(leg) if form == "urdf" else spec.to_xml()
    return Kind({"leg.xml": text.encode()}, "leg.xml", read)


def _gains():
    from importlib import resources

    from hopping_leg.controllers.energy_shaping.gains import load_gains

    gains = resources.files("hopping_leg.controllers") / "gains" / "energy-shaping.toml"
    return Kind({"gains.toml": gains.read_bytes()}, "gains.toml", load_gains)


def _faults():
    from hopping_leg.emulator.faults import load_faults

    script = b'[[fault]]\nkind = "late_reply"\nsince = "flight"\nat = 2.0\n'
    script += b'drive = "knee"\nvalue = 0.012\ncount = 3\n\n[[fault]]\nkind = "configuration"\n'
    script += b'name = "servo.max_current_A"\nvalue = 20.0\nduration = 0.1\n'
    return Kind({"faults.toml": script}, "faults.toml", load_faults)


def _recordings(form):
    from hopping_leg.identify.recording import load_recording
    from tests.identify.runs import SIDECAR, rig_log

    if form == "rig":
        return Kind({"log.csv": rig_log(rows=80).write_csv().encode()}, "log.csv", load_recording)
    files = {"run.toml": SIDECAR.encode(), "run.csv": _table().write_csv().encode()}
    if form == "gzip":
        files["run.csv.gz"] = gzip.compress(files.pop("run.csv"))
        return Kind(files, "run.csv.gz", load_recording, text=False)
    if form == "sidecar":
        return Kind(files, "run.toml", lambda path: load_recording(path.with_name("run.csv")))
    return Kind(files, "run.csv", load_recording)


def _bags(form):
    from hopping_leg.formats import to_mcap
    from hopping_leg.identify.recording import load_recording
    from hopping_leg.trace import Trace
    from tests.identify.runs import SIDECAR
    from tests.test_formats import record

    if form == "mcap":
        files = {"run.toml": SIDECAR.encode(), "run.mcap": to_mcap(Trace(_table()))}
        return Kind(files, "run.mcap", load_recording, text=False)
    files = _written(lambda folder: record(folder / "run", "sqlite3", _table()))
    (name,) = (name for name in files if name.endswith(".db3"))
    return Kind({"run/run.toml": SIDECAR.encode(), **files}, name, load_recording, text=False)


def _traces(form):
    from hopping_leg.identify.excitation import Multisine, load_excitation, make_excitation
    from hopping_leg.identify.recording import load_recording
    from hopping_leg.robot import load_robot

    if form == "excitation":
        excitation = make_excitation(Multisine(duration=12.0), load_robot("legv2"))
        files = _written(lambda folder: excitation.save(folder / "run.parquet"))
        whole = io.BytesIO(files["run.parquet"])
        header = pl.read_parquet_metadata(whole)["hopping_leg"].encode()
        seal = functools.partial(_native, table=pl.read_parquet(whole))
        return Kind(files, "run.parquet", load_excitation, content=header, seal=seal)
    recording = {"rig": "fixed-base", "rate_hz": 200.0, "robot": "legv2", "source": "made up"}
    header = json.dumps({"schema": 1, "events": [], "recording": recording}).encode()
    files = {"run.parquet": _native(header)}
    return Kind(files, "run.parquet", load_recording, content=header, seal=_native)


def _boxes(form):
    from hopping_leg.deploy.flight_recorder import FlightRecorder
    from hopping_leg.flight_recording import recover

    columns = ("time_s", "command_m", "hip_position_rad")
    first = json.dumps({"columns": columns, "header": {"robot": "legv2"}}).encode()
    row, event = struct.pack("<3d", 1, 2, 3), json.dumps({"state": "damping"}).encode()
    framed = b"\n\n".join([b"0" + first, b"1" + row, b"2" + event, b"1" + row])

    def write(folder):
        box = FlightRecorder(folder / "run.blackbox", columns, {"robot": "legv2"})
        for tick in range(9):
            box.row([float(tick), 0.3, 1.0])
        box.event(state="damping")
        box.close()

    files = _written(write)
    if form == "raw":
        return Kind(files, "run.blackbox", recover, text=False)
    seal = functools.partial(_framed, first)
    return Kind(files, "run.blackbox", recover, content=framed, seal=seal)


def _checkpoints():
    from hopping_leg.rl.checkpoint import read_checkpoint, write_checkpoint

    tree = {"weights": np.arange(60.0).reshape(3, 20), "steps": 7, "names": ["a", {"b": np.eye(2)}]}
    files = _written(lambda folder: write_checkpoint(folder, 7, tree))
    return Kind(files, *files, read_checkpoint, text=False)


def _policies(form):
    from hopping_leg.controllers.policy import Policy
    from hopping_leg.controllers.registry import load_policy

    policy = load_policy("fast")
    files = {"policy.onnx": policy.content}
    if form == "card":
        card = policy.card.to_json().encode()
        seal = functools.partial(_with_card, policy.content)
        return Kind(files, "policy.onnx", Policy.load, content=card, seal=seal)
    return Kind(files, "policy.onnx", Policy.load, text=False)


KINDS = {
    "robot": _robots,
    **{f"description-{f}": functools.partial(_descriptions, f) for f in ("urdf", "mjcf")},
    "gains": _gains,
    "faults": _faults,
    **{
        f"recording-{form}": functools.partial(_recordings, form)
        for form in ("csv", "rig", "gzip", "sidecar")
    },
    **{f"bag-{form}": functools.partial(_bags, form) for form in ("mcap", "sqlite")},
    **{f"trace-{f}": functools.partial(_traces, f) for f in ("header", "excitation")},
    **{f"flight-recorder-{f}": functools.partial(_boxes, f) for f in ("raw", "framed")},
    "checkpoint": _checkpoints,
    **{f"policy-{f}": functools.partial(_policies, f) for f in ("raw", "card")},
}
"""What makes each kind."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_no_mutated_file_ends_in_anything_but_a_sentence(kind):
    words = [sys.executable, "-m", "tests.test_fuzz", kind, str(COUNT)]
    done = subprocess.run(words, capture_output=True, text=True, errors="replace")
    assert done.returncode == 0, f"{done.stdout[-20:]}: {done.stderr[-3000:]}"


def main(name, count):
    """Try seeds; the last one that is printed ended in something else."""
    kind = KINDS[name]()

    def too_long(*_):
        raise RuntimeError(f"it took more than {SECONDS} s")

    signal.signal(signal.SIGALRM, too_long)
    with tempfile.TemporaryDirectory() as folder:
        kind.write(Path(folder) / "files", kind.content)
        kind.read(Path(folder) / "files" / kind.name)  # what is not mutated is read
        for seed in range(count):
            print(seed, flush=True)
            kind.try_seed(Path(folder) / "files", (zlib.crc32(name.encode()), seed))
            assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 < MEMORY


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
