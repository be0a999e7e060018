"""Policy files: their command corrected, in whatever layout, with and without a memory."""

import itertools

import numpy as np
import onnxruntime
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hopping_leg.controllers.observation_history import make_observation_history
from hopping_leg.controllers.policy import Card
from hopping_leg.errors import UsageError
from hopping_leg.rl.onnx_export import (
    CommandMap,
    Network,
    RecurrentUnit,
    build_policy,
    with_command_map,
)

MEMORY = 4


def shapes(layout):
    return make_observation_history(layout, 0.005).shapes


def made(layout, *, remembers=False):
    """Return the file of a policy that depends on every input, and on its command the most."""
    rng = np.random.default_rng(0)
    sizes = {name: int(np.prod(shape)) for name, shape in shapes(layout).items()}
    total = sum(sizes.values())
    gain = np.concatenate([np.full(k, 5.0 if n == "command" else 0.5) for n, k in sizes.items()])
    wide = [MEMORY + total if remembers else total, 8, 2]
    layers = [
        (rng.normal(size=(b, a)) / np.sqrt(a), rng.normal(0, 0.1, b))
        for a, b in itertools.pairwise(wide)
    ]
    shape = ((3 * MEMORY, total), (3 * MEMORY, MEMORY), 3 * MEMORY, 3 * MEMORY)
    unit = RecurrentUnit(*(rng.normal(0, 0.3, s) for s in shape)) if remembers else None
    network = Network(np.full(total, 0.1), gain, layers, "tanh", "clip", memory=unit)
    card = Card("test", layout, 0.2, 0.4, (6.0, 6.0), "legv2", "0" * 16, 200.0)
    return build_policy(network, card)


def feeds(layout, seed=0, *, remembers=False):
    rng = np.random.default_rng(seed)
    arrays = {n: rng.uniform(-1, 1, (6, *s)).astype(np.float32) for n, s in shapes(layout).items()}
    arrays["command"] = rng.uniform(0.15, 0.5, arrays["command"].shape).astype(np.float32)
    if remembers:
        counts = np.zeros((6, 1))
        remembered = np.concatenate([rng.uniform(-1, 1, (6, MEMORY)), counts], axis=1)
        arrays["memory"] = remembered.astype(np.float32)
    return arrays


def outputs(graph, given_arrays):
    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, given_arrays), strict=True))


def shown(layout):
    """Return the file of a policy whose torques, N m, are its newest and oldest command, m."""
    sizes = {name: int(np.prod(shape)) for name, shape in shapes(layout).items()}
    columns = np.repeat(list(sizes), list(sizes.values()))
    weight = np.zeros((2, len(columns)))
    weight[[0, 1], np.flatnonzero(columns == "command")[[0, -1]]] = 1
    network = Network(
        np.zeros(len(columns)), np.ones(len(columns)), [(weight, np.zeros(2))], "tanh", "clip"
    )
    card = Card("test", layout, 0.2, 0.4, (1.0, 1.0), "legv2", "0" * 16, 200.0)
    return build_policy(network, card)


@st.composite
def maps(draw, most=25):
    """Draw a map as calibration makes it: heights a centimetre apart or so, shifts of 2 cm."""
    count = draw(st.integers(1, most))
    steps = draw(st.lists(st.floats(0.005, 0.02), min_size=count, max_size=count))
    shifts = draw(st.lists(st.floats(-0.02, 0.02), min_size=count, max_size=count))
    return CommandMap(tuple((0.15 + np.cumsum(steps)).tolist()), tuple(shifts))


def corrected(command, correction):
    return command + np.interp(command, correction.heights, correction.shifts)


@given(maps(), st.integers(0, 2**32 - 1), st.sampled_from(["dated", "three-samples"]))
@settings(max_examples=40)
def test_a_command_map_adds_what_numpy_interpolates(correction, seed, layout):
    """To every command of the history, also to those beyond the map's heights."""
    asked = feeds(layout, seed)
    told = outputs(with_command_map(shown(layout), correction), asked)["torque"]
    expected = corrected(asked["command"].reshape(6, -1)[:, [0, -1]].astype(float), correction)
    np.testing.assert_allclose(told, expected, rtol=0, atol=1e-6)


CASES = [("dated", False), ("dated", True), ("three-samples", False), ("three-samples", True)]


@pytest.mark.parametrize(("layout", "remembers"), CASES)
def test_maps_compose_and_change_nothing_but_the_command(layout, remembers):
    """The latest is the first to act; what is remembered follows the corrected command, too."""
    content, asked = made(layout, remembers=remembers), feeds(layout, remembers=remembers)
    first = CommandMap((0.2, 0.3, 0.4), (0.01, -0.02, 0.015))
    second = CommandMap((0.25, 0.35), (-0.02, 0.01))
    twice = with_command_map(with_command_map(content, first), second)
    wanted = corrected(corrected(asked["command"].astype(float), second), first)
    expected = outputs(content, {**asked, "command": wanted.astype(np.float32)})
    told, plain = outputs(twice, asked), outputs(content, asked)
    assert told.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(told[name], values, rtol=0, atol=2e-5)
        assert np.abs(values - plain[name]).max() > 1e-3


def test_an_activation_that_onnx_does_not_know_is_refused():
    with pytest.raises(UsageError, match=r"'gelu' with squash 'clip' .* relu, tanh, elu"):
        Network(np.zeros(1), np.ones(1), [], "gelu", "clip")
