"""JSON files say null where there is no number, and nothing else changes."""

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hopping_leg.errors import TraceError
from hopping_leg.json_files import json_text, plain, write_json

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)  # fmt: skip


def test_json_has_null_where_there_is_no_number(tmp_path):
    file = tmp_path / "deep" / "x.json"
    write_json(file, {"a": [math.nan, 1.5, (math.inf,)], "b": None})
    assert json.loads(file.read_text()) == {"a": [None, 1.5, [None]], "b": None}


@given(VALUES)
def test_what_json_knows_comes_back(value):
    assert plain(value) == value
    assert json.loads(json_text(value)) == value


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(TraceError):
        write_json(tmp_path, {})
