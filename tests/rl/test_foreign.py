"""Networks that others trained on the environment act as policies as they did there."""

import base64
import json
import zipfile
from contextlib import nullcontext
from pathlib import Path

import gymnasium
import numpy as np
import onnx
import pytest
import torch
from gymnasium.wrappers import NormalizeObservation, TransformObservation
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize
from torch import nn

import hopping_leg
from hopping_leg.cli import main
from hopping_leg.controllers.policy import Policy
from hopping_leg.controllers.registry import load_controller
from hopping_leg.envs.gymnasium_envs import HoppingEnv
from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.robot import DEFAULT_ROBOT, load_robot
from tests.doc_pages import ROOT

LEG = load_robot(DEFAULT_ROBOT)
MODELS = {
    "ppo": (PPO, {}),
    "ppo-sde": (PPO, {"use_sde": True, "policy_kwargs": {"squash_output": True}}),
    "sac": (SAC, {"policy_kwargs": {"net_arch": {"pi": [8], "qf": [8]}}}),
    "sac-sde": (SAC, {"use_sde": True, "policy_kwargs": {"activation_fn": nn.ELU}}),
    "td3": (TD3, {}),
}


def made(**words):
    return gymnasium.make("HoppingLeg-v0", **words)


def trained(name="ppo", env=None):
    """Return a model with actions of all sizes."""
    kind, words = MODELS[name]
    model = kind("MlpPolicy", env or made(), seed=0, device="cpu", **words)
    with torch.no_grad():
        for parameter in model.policy.parameters():
            parameter.mul_(4.0)
    return model


def check(policy, predict, env=None):
    """Assert that a policy acts as a network does on what the environment shows."""
    env, actions = env or made(), []
    seen, _ = env.reset(seed=1)
    policy.reset(1)
    for _ in range(20):
        actions.append(np.clip(predict(seen), -1, 1))
        torque = policy.act(env.unwrapped.task.measurement)[0]
        np.testing.assert_allclose(torque / policy.card.torque_scale, actions[-1], atol=1e-5)
        seen, *_ = env.step(actions[-1].astype(np.float32))
    assert np.ptp(actions) > 1e-2


@pytest.mark.parametrize("name", MODELS)
def test_stable_baselines_policy_is_the_same_from_the_model_its_zip_and_its_own_onnx(
    name, tmp_path
):
    model = trained(name)

    class Deterministic(nn.Module):
        def forward(self, observation):
            return model.policy._predict(observation, deterministic=True)

    graph = Deterministic()
    graph.policy = model.policy
    zeros = torch.zeros(1, 15)
    torch.onnx.export(graph, zeros, tmp_path / "a.onnx", opset_version=17, dynamo=False)
    model.save(tmp_path / "b.zip")
    for policy in (
        hopping_leg.export_policy(model, tmp_path / "c.onnx"),
        *(load_controller(tmp_path / file, LEG) for file in ("a.onnx", "b.zip", "c.onnx")),
    ):
        check(policy, lambda seen: model.predict(seen, deterministic=True)[0])
    assert not policy.stranger(LEG, "c")
    stranger = load_controller(tmp_path / "b.zip", LEG)
    assert "write robot" in stranger.stranger(LEG, "b"), "it does not say on what it was trained"
    (tmp_path / "b.toml").write_text(f'robot = "{DEFAULT_ROBOT}"')
    assert not load_controller(tmp_path / "b.zip", LEG).stranger(LEG, "b")


def test_normalisation_of_the_environment_is_taken_over(tmp_path):
    env = VecNormalize(DummyVecEnv([made]), clip_obs=1.5)
    model = trained(env=env)
    env.obs_rms.mean, env.obs_rms.var = np.linspace(-1, 1, 15), np.linspace(0.1, 2, 15)
    policy = hopping_leg.export_policy(model, tmp_path / "a.onnx")
    check(policy, lambda seen: model.predict(env.normalize_obs(seen), deterministic=True)[0])
    net, env = nn.Sequential(nn.Linear(15, 2), nn.Tanh()), NormalizeObservation(made())
    env.obs_rms.mean, env.update_running_mean = np.ones(15), False
    policy = hopping_leg.export_policy(net, tmp_path / "b.onnx", env)
    check(policy, lambda seen: net(torch.from_numpy(seen).float()).detach().numpy(), env)


def test_a_recurrent_policy_remembers(tmp_path):
    contrib = pytest.importorskip("sb3_contrib")
    model, state = contrib.RecurrentPPO("MlpLstmPolicy", made(), seed=0, device="cpu"), None
    with torch.no_grad():
        model.policy.action_net.weight.mul_(100)

    def predict(seen):
        nonlocal state
        action, state = model.predict(seen, state, deterministic=True)
        return action

    check(hopping_leg.export_policy(model, tmp_path / "a.onnx"), predict)
    model.save(tmp_path / "a.zip")
    with pytest.raises(PolicyError, match=r"\(it has an LSTM\); load it and use `hop.*export_pol"):
        load_controller(tmp_path / "a.zip", LEG)


def test_what_cannot_be_a_policy_is_refused_with_the_remedy(tmp_path):
    def refused(error, says, model, env=None, **words):
        with pytest.raises(error, match=says):
            hopping_leg.export_policy(model, tmp_path / "a.onnx", env, **words)

    net, env = nn.Linear(15, 3), made()
    refused(UsageError, "env=", net)
    refused(PolicyError, "act=", net, env)
    refused(PolicyError, r"\(n, 15\)", nn.Linear(14, 2), env)
    changed = TransformObservation(env, lambda seen: 2 * seen, env.observation_space)
    refused(UsageError, "TransformObservation", net, changed)
    policy = hopping_leg.export_policy(net, tmp_path / "b.onnx", env, act=lambda m, x: m(x)[:, :2])
    check(policy, lambda seen: net(torch.from_numpy(seen)).detach().numpy()[:2])
    assert not list(tmp_path.glob("a.*"))
    (tmp_path / "a.pt").touch()
    with pytest.raises(PolicyError, match="export_policy"):
        load_controller(tmp_path / "a.pt", LEG)


class Noise(nn.Module):
    def forward(self, seen):
        return seen[:, :2] + torch.randn_like(seen)[:, :2]


@pytest.mark.parametrize(
    ("graph", "size", "says"),
    [
        (nn.Linear(14, 2), (1, 14), r"as \[1, 15\].*a\.toml"),
        (nn.Linear(15, 2), (15,), r"takes \[\[15\]\], not observations as \[1, 15\]; export it so"),
        (nn.Linear(15, 3), (1, 15), "two deterministic"),
        (Noise(), (1, 15), "at random"),
        (nn.Sequential(nn.LayerNorm(15), nn.Linear(15, 2)), (1, 15), ""),
    ],
)
def test_only_a_network_of_deterministic_actions_is_taken(graph, size, says, tmp_path):
    file, zeros = tmp_path / "a.onnx", torch.zeros(size)
    torch.onnx.export(graph, zeros, file, opset_version=20, dynamo=False)
    with pytest.raises(PolicyError, match=says) if says else nullcontext():
        load_controller(file, LEG)


def test_nothing_of_a_zip_is_unpickled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    trained().save("a.zip")
    with zipfile.ZipFile("a.zip") as file:
        parts = {name: file.read(name) for name in file.namelist()}
    data, bomb = json.loads(parts["data"]), b"cos\nsystem\n(S'touch exploded'\ntR."
    data["policy_class"][":serialized:"] = base64.b64encode(bomb).decode()
    for change in ({"data": json.dumps(data)}, {"policy.pth": bomb}, {"data": "[]"}):
        with zipfile.ZipFile("b.zip", "w") as file:
            for name, content in (parts | change).items():
                file.writestr(name, content)
        fine = ":serialized:" in str(change)
        with nullcontext() if fine else pytest.raises(PolicyError, match="not read as an actor"):
            load_controller("b.zip", LEG)
        assert not Path("exploded").exists()


def test_a_contract_beside_a_policy_tells_all_and_is_refused_where_it_differs(tmp_path):
    file, beside = tmp_path / "fast.onnx", tmp_path / "fast.json"
    assert main(["export", "policy", "fast", "--out", str(file)]) == 0
    told = json.loads(beside.read_text())
    robot = load_robot(told["robot"])
    assert told["robot_digest"] == robot.digest
    graph = onnx.load(file).graph
    sizes = {
        i.name: [d.dim_value or "n" for d in i.type.tensor_type.shape.dim] for i in graph.input
    }
    assert {name: about["shape"] for name, about in told["inputs"].items()} == sizes
    assert told["inputs"]["qd"]["unit"] == "rad/s"
    assert told["inputs"]["past_torque"]["ticks_ago"][:2] == [1, 2]
    assert "age of every sample" in told["limit_of_inputs"]
    for change in ({"rate": 100.0}, {"robot_digest": "0" * 16}, {"policy_sha256": "0"}):
        beside.write_text(json.dumps(told | change))
        with pytest.raises(PolicyError, match=f"'{next(iter(change))}' differs"):
            Policy.load(file)
    card = Policy.load(ROOT / "src/hopping_leg/policies/fast.onnx").card
    wrong = json.loads(card.to_json()) | {"inputs": {}}
    with pytest.raises(PolicyError, match="other inputs"):
        type(card).from_json(json.dumps(wrong), "here")


def test_a_run_is_filmed(tmp_path, monkeypatch):
    pytest.importorskip("moviepy", reason="needs the extra 'video'")
    monkeypatch.setattr(HoppingEnv, "render", lambda _: np.zeros((64, 64, 3), np.uint8))
    env = gymnasium.wrappers.RecordVideo(made(render_mode="rgb_array"), str(tmp_path))
    env.reset(seed=0)
    for _ in range(20):
        env.step(np.zeros(2, np.float32))
    env.close()
    (film,) = tmp_path.glob("*.mp4")
    assert film.stat().st_size > 100
