"""Policy files do what their module does; their command can be shifted."""

import warnings

import numpy as np
import onnxruntime
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from hopping_leg.controllers.policy import Card, Policy
from hopping_leg.envs import TaskConfig
from hopping_leg.envs.observation import make_observation
from hopping_leg.rl.onnx_export import (
    DenseActor,
    PolicyGraph,
    build_policy,
    every_centimetre,
    with_shifts,
)
from hopping_leg.rl.students import StudentConfig
from hopping_leg.robot import load_robot

ROBOT = load_robot("legv2-paper")
LAYOUTS = ("three-samples", "dated", "dated-long", "any-leg")
HEIGHTS = np.array(every_centimetre((0.2, 0.4)))


def parts(layout, kind="tanh"):
    """Return actor, observation and card of an untrained policy."""
    torch.manual_seed(0)
    seen = make_observation(ROBOT, TaskConfig(observation=layout), 1)
    if kind == "gru":
        config = StudentConfig("gru", hidden=(8,), size=4, update_every=2, correction=0.3)
        actor = config.make(seen, 5)
    else:
        activation = {"tanh": nn.Tanh, "relu": nn.ReLU, "elu": nn.ELU}[kind]
        actor = DenseActor(nn.Linear(seen.size, 8), activation(), nn.Linear(8, 2))
    return actor, seen, Card("test", layout, 0.2, 0.4, (6.0, 5.0), "legv2", "0" * 16, 200.0)


def made(layout="three-samples", kind="tanh"):
    return build_policy(*parts(layout, kind))


def shown(layout):
    """Return the file of a policy whose torques, N m, are its newest and oldest command, m."""
    _, seen, _ = parts(layout)
    seen.scaling.offset[:], seen.scaling.gain[:] = 0, 1
    actor = DenseActor(nn.Linear(seen.size, 2, bias=False))
    nn.init.zeros_(actor.layers[0].weight)
    commands = 3 if layout == "three-samples" else 1
    with torch.no_grad():
        actor.layers[0].weight[[0, 1], seen.order[[-commands, -1]]] = 1
    return build_policy(actor, seen, Card("test", layout, 0.2, 0.4, (1, 1), "", "0" * 16, 200.0))


def outputs(content, given_arrays):
    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, given_arrays), strict=True))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("kind", ["tanh", "relu", "elu", "gru"])
def test_a_file_gives_what_torch_gives_for_any_number_of_legs(layout, kind, capfd):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        content = made(layout, kind)
    assert capfd.readouterr() == ("", "")
    assert content == made(layout, kind), "the same weights give the same bytes"
    graph = PolicyGraph(*parts(layout, kind))
    Policy(content, "here", "test")  # inputs, outputs and card are those of a policy
    for count in (1, 7):
        given_arrays = {name: torch.randn(count, *shape) for name, shape in graph.inputs.items()}
        if kind == "gru":
            given_arrays["memory"][:, -2:] = torch.tensor([0.0, 0.01])
        with torch.no_grad():
            wanted = graph(*given_arrays.values())
        told = outputs(content, {name: value.numpy() for name, value in given_arrays.items()})
        assert list(told) == ["torque", "next_memory"][: len(wanted)]
        for name, value in zip(told, wanted, strict=True):
            np.testing.assert_allclose(told[name], value.numpy(), rtol=1e-6, atol=1e-6 * 6)


@given(
    st.lists(st.floats(-0.02, 0.02), min_size=len(HEIGHTS), max_size=len(HEIGHTS)),
    st.integers(0, 2**32 - 1),
    st.sampled_from(["dated", "three-samples"]),
)
@settings(max_examples=20)
def test_shifts_of_the_command_are_what_numpy_interpolates(shifts, seed, layout):
    """Of every command of the history, also of those beyond the heights; the latest shifts hold."""
    content = shown(layout)
    graph, rng = PolicyGraph(*parts(layout)), np.random.default_rng(seed)
    asked = {
        name: rng.uniform(0.15, 0.5, (6, *shape)).astype(np.float32)
        for name, shape in graph.inputs.items()
    }
    command = asked["command"][:, [0, -1]].astype(float)
    np.testing.assert_allclose(outputs(content, asked)["torque"], command, atol=1e-6)
    told = outputs(with_shifts(with_shifts(content, HEIGHTS), np.array(shifts)), asked)["torque"]
    expected = command + np.interp(command, HEIGHTS, shifts)
    np.testing.assert_allclose(told, expected, rtol=0, atol=2e-6)
