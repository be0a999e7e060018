"""Policy files: written and read back, their command corrected, their hidden layers shown."""

import itertools

import numpy as np
import onnx
import onnxruntime
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import helper

from hopping_leg.controllers.observation_history import make_observation_history
from hopping_leg.controllers.policy import Card, Policy
from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.rl.onnx_export import (
    CommandMap,
    Network,
    RecurrentUnit,
    build_policy,
    expose_hidden,
    read_network,
    with_command_map,
)

MEMORY = 4


def shapes(layout):
    return make_observation_history(layout, 0.005).shapes


def made(layout, hidden=(8,), *, remembers=False):
    """Return the file of a policy that depends on every input, and on its command the most."""
    rng = np.random.default_rng(0)
    sizes = {name: int(np.prod(shape)) for name, shape in shapes(layout).items()}
    total = sum(sizes.values())
    gain = np.concatenate([np.full(k, 5.0 if n == "command" else 0.5) for n, k in sizes.items()])
    wide = [MEMORY if remembers else total, *hidden, 2]
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
        arrays["memory"] = rng.uniform(-1, 1, (6, MEMORY)).astype(np.float32)
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


@pytest.mark.parametrize("layout", ["dated", "three-samples"])
@pytest.mark.parametrize("maps", [0, 1, 2])
def test_a_policy_written_again_does_the_same_or_is_refused_for_its_memory(layout, maps):
    content, asked = made(layout), feeds(layout)
    for shift in (0.02, -0.01)[:maps]:
        content = with_command_map(content, CommandMap((0.2, 0.4), (shift, 0.0)))
    again = build_policy(read_network(content), Policy(content, "here", "test").card)
    told, expected = outputs(again, asked), outputs(content, asked)
    np.testing.assert_allclose(told["torque"], expected["torque"], rtol=0, atol=2e-5)
    assert maps or again == content
    with pytest.raises(PolicyError, match="remembers"):
        read_network(made(layout, remembers=True))


def test_hidden_layers_follow_the_torque():
    content, asked = made("dated", (8, 5)), feeds("dated")
    plain, extended = outputs(content, asked), outputs(expose_hidden(content), asked)
    assert list(extended) == ["torque", "hidden_0", "hidden_1"]
    np.testing.assert_array_equal(plain["torque"], extended["torque"])
    assert [extended[f"hidden_{i}"].shape for i in range(2)] == [(6, 8), (6, 5)]
    assert np.abs(extended["hidden_1"]).max() <= 1
    assert np.ptp(extended["hidden_1"], axis=0).min() > 0


def test_graphs_that_are_not_ours_are_refused():
    with pytest.raises(PolicyError, match="no hidden layer"):
        expose_hidden(made("dated", ()))
    node = helper.make_node("Identity", ["x"], ["y"])
    value = [helper.make_tensor_value_info(n, onnx.TensorProto.FLOAT, ["n"]) for n in "xy"]
    model = helper.make_model(helper.make_graph([node], "g", value[:1], value[1:]))
    with pytest.raises(PolicyError, match="dense layers"):
        read_network(model.SerializeToString())
    with pytest.raises(UsageError, match=r"'gelu' with squash 'clip' .* relu, tanh, elu"):
        Network(np.zeros(1), np.ones(1), [], "gelu", "clip")
