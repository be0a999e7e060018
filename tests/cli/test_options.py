import pytest
import tyro
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.cli.options import Heights, parse_heights
from hopping_leg.errors import UsageError


@given(st.lists(st.floats(0.1, 1).map(lambda h: round(h, 4)), min_size=1, max_size=6))
def test_heights_are_read_as_they_are_written(heights):
    text = ",".join(f"{h:g}" for h in heights)
    assert parse_heights(text) == pytest.approx(heights)


def test_heights_on_a_command_line():
    assert tyro.cli(Heights, args=["0.25,0.3"]) == (0.25, 0.3)


@pytest.mark.parametrize("text", ["", "high", "0.2,,0.3", "0.2;0.3"])
def test_other_texts_are_no_heights(text):
    with pytest.raises(UsageError, match="separated by commas"):
        parse_heights(text)
