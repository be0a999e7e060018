"""Option types are read as they are written; the command beside a result gives its options."""

import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import pytest
import tyro
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.cli.options import Heights, command_line, parse_heights, verb_of
from hopping_leg.errors import UsageError


@dataclass(frozen=True)
class Inner:
    depth: int = 1


@dataclass(frozen=True)
class Options:
    names: tyro.conf.Positional[tuple[str, ...]] = ("a",)
    heights: Heights | None = None
    some_numbers: tuple[int, ...] = (1, 2)
    video: bool = True
    loud: bool = False
    inner: Annotated[Inner, tyro.conf.arg(name="")] = field(default_factory=Inner)
    file: Path | None = None
    out: Path = Path("here")


words = st.text(st.characters(categories=("L", "N")) | st.sampled_from(" '*_."), min_size=1)


@given(
    st.builds(
        Options,
        names=st.tuples(words, words) | st.just(("a",)),
        heights=st.none()
        | st.lists(st.integers(1, 99).map(lambda cm: cm / 100), min_size=1).map(tuple),
        some_numbers=st.lists(st.integers(0, 9), min_size=1).map(tuple),
        video=st.booleans(),
        loud=st.booleans(),
        inner=st.builds(Inner, st.integers(0, 9)),
        file=st.none() | words.filter(lambda word: word == str(Path(word))).map(Path),
    )
)
def test_tyro_reads_the_command_back(options):
    verb, *rest = shlex.split(command_line("hop", options))
    assert verb == "hop"
    assert tyro.cli(Options, args=rest) == options


@dataclass(frozen=True)
class TwoWords(Options):
    pass


def test_defaults_and_what_changes_no_number_are_left_out_and_names_are_tyros(capsys):
    assert command_line("hop", Options(out=Path("there"))) == "hop"
    assert command_line("hop", Options(out=Path("there")), ()) == "hop --out there"
    assert verb_of(TwoWords()) == "two-words"
    assert command_line("hop two-words", TwoWords(loud=True)) == "hop two-words --loud"
    with pytest.raises(SystemExit):
        tyro.cli(Options | TwoWords, args=["--help"])
    assert "two-words" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["", "high", "0.2,,0.3", "0.2;0.3"])
def test_other_texts_are_no_heights(text):
    with pytest.raises(UsageError, match="separated by commas"):
        parse_heights(text)
