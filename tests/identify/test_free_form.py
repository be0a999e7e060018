"""Whatever lies in a file, a person reads a sentence, never a stack trace."""

import contextlib
import gzip
import string

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hopping_leg.errors import HoppingLegError
from hopping_leg.identify.columns import COLUMNS
from hopping_leg.identify.importers import IMPORTERS
from hopping_leg.identify.recording import load_recording
from tests.identify.runs import SIDECAR

KNOWN = sorted({n for i in IMPORTERS.values() for n in (*i.COLUMNS, *i.NAMES)} | set(COLUMNS))
FIELDS = st.one_of(
    st.floats().map(repr),
    st.integers(-5, 5).map(str),
    st.sampled_from(["", "nan", "inf", "-0", "1e400", "5e-324", "true", "STAGING", '"', " 3 "]),
    st.text(string.printable, max_size=6),
)


def sentences_about(path):
    """Return what a person would read: the refusal, or the warnings."""
    try:
        return list(load_recording(path).warnings)
    except HoppingLegError as error:
        return [str(error)]


def read(path):
    for sentence in sentences_about(path):
        assert sentence.startswith(str(path.parent))
        assert sentence.endswith((".", "?"))


@st.composite
def tables(draw):
    importer = draw(st.sampled_from([*IMPORTERS.values(), None]))
    names = draw(st.lists(st.sampled_from(KNOWN), max_size=6, unique=True))
    names = [*(importer.COLUMNS if importer else ()), *names]
    names = draw(st.permutations(sorted(set(names)))) or ["t"]
    rows = draw(st.integers(0, 4))
    lines = [[draw(FIELDS) for _ in names] for _ in range(rows)]
    repeat = draw(st.sampled_from([1, 1, 12]))
    return "\n".join(",".join(line) for line in [names, *lines * repeat])


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.one_of(st.binary(max_size=60), tables().map(str.encode)), sidecar=st.booleans())
def test_random_tables(tmp_path, content, sidecar):
    path, beside = tmp_path / "run.csv", tmp_path / "run.toml"
    path.write_bytes(content)
    with contextlib.suppress(FileNotFoundError):
        beside.unlink()
    if sidecar:
        beside.write_text(SIDECAR)
    read(path)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.data(),
    rows=st.integers(25, 40),
    columns=st.lists(st.sampled_from(sorted(COLUMNS)), min_size=1, max_size=8, unique=True),
)
def test_random_numbers_in_time_order(tmp_path, data, rows, columns):
    columns = [c for c in columns if c not in ("time_s", "row")]
    number = st.floats(-3, 3) | st.sampled_from([float("inf"), float("nan"), 5e-324, 0.0])
    lines = ["time_s," + ",".join(columns)]
    values = data.draw(st.lists(number, min_size=5, max_size=5))
    for row in range(rows):
        fields = [repr(values[(row * 7 + i) % 5]) for i in range(len(columns))]
        lines.append(f"{row / 200}," + ",".join(fields))
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines).replace(",\n", "\n").rstrip(","))
    path.with_suffix(".toml").write_text(SIDECAR)
    read(path)


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sidecar=st.text(max_size=40) | st.sampled_from(["columns = {}", "rig = 3", "[rig]"]))
def test_random_sidecars(tmp_path, sidecar):
    path = tmp_path / "run.csv"
    path.write_text("time_s,hip_position_rad\n0,1\n")
    path.with_suffix(".toml").write_text(sidecar, encoding="utf-8")
    read(path)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(0, 400), at=st.integers(0, 400), byte=st.integers(0, 255))
def test_damaged_gzip(tmp_path, cut, at, byte):
    whole = bytearray(gzip.compress(b"t,pos\n" + b"1.0,2.0\n" * 200, mtime=0))
    whole[at % len(whole)] = byte
    path = tmp_path / "run.csv.gz"
    path.write_bytes(bytes(whole[: len(whole) - cut % len(whole)]))
    read(path)
