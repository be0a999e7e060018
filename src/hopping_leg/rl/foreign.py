"""Policies of networks that others trained on the environment.

``export_policy`` takes a model in memory. ``convert`` takes files: of a stable-baselines3 ``.zip``
the weights and the JSON alone, as nothing is unpickled, and ONNX networks from observations to
actions. ``NAME.toml`` beside such a file says what the environment was made with, see ``Made``.
"""

import io
import json
import re
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from gymnasium.spaces import Box
from onnx import helper
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.sac.policies import SACPolicy
from stable_baselines3.td3.policies import TD3Policy
from torch import nn

from hopping_leg.controllers.policy import Card, Policy, open_session
from hopping_leg.envs import TaskConfig
from hopping_leg.envs.observation import Observation, make_observation
from hopping_leg.envs.task import HoppingTask
from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.io import one_line, parse_toml, read_dataclass, versions
from hopping_leg.rl.onnx_export import Actor, DenseActor, build_policy, make_card, with_card
from hopping_leg.robot import DEFAULT_ROBOT, load_robot, shipped_robots

_HARMLESS = ("NormalizeObservation", "FlattenObservation", "ClipAction")  # wrappers
_CHANGES = re.compile(r"gymnasium\.(core|vector\.\w+)\.(Vector)?(Observation|Action)Wrapper")

_OPTIONS = ("net_arch", "squash_output", "clip_mean", "full_std", "use_expln")
"""What stable-baselines3's actors are made with, beside use_sde and activation_fn."""

_MOST, _WIDEST = 1 << 29, 1 << 14  # bytes of weights, and neurons
_NETWORK = "network"  # function of a policy's graph

Act = Callable[[Any, torch.Tensor], torch.Tensor]


@dataclass(frozen=True)
class Made:
    """What the environment of a training was made with."""

    robot: str = ""
    """A shipped robot, or a robot file as seen from this one."""
    options: TaskConfig = field(default_factory=TaskConfig)
    """Options of the environment."""


class _Model(Actor):
    """A model's deterministic actions, of observations normalised as its environment does."""

    def __init__(self, module: Any, act: Act | None = None, layers: Sequence[Any] = ()) -> None:  # noqa: ANN401
        super().__init__()
        self.module, self._act, self._layers = module, act, layers
        self._lstm: Any = None if act else getattr(module, "lstm_actor", None)
        if self._lstm:
            self.memory_size = 2 * self._lstm.num_layers * self._lstm.hidden_size

    def forward(
        self, observation: torch.Tensor, memory: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the actions; memory is that of a recurrent policy of sb3-contrib."""
        for layer in reversed(self._layers):
            mean, var = (torch.tensor(v).float() for v in (layer.obs_rms.mean, layer.obs_rms.var))
            observation = (observation - mean) / (var + layer.epsilon).sqrt()
            observation = observation.clip(-(most := getattr(layer, "clip_obs", 1e9)), most)
        if self._lstm:
            shape = (-1, 2, self._lstm.num_layers, self._lstm.hidden_size)
            h, c = memory.reshape(shape).permute(1, 2, 0, 3)
            state, begun = (h.contiguous(), c.contiguous()), torch.zeros(len(observation))
            action, state = self.module._predict(observation, state, begun, deterministic=True)
            memory = torch.stack(state).permute(2, 0, 1, 3).flatten(1)
        elif self._act:
            action = self._act(self.module, observation)
        elif hasattr(self.module, "_predict"):
            action = self.module._predict(observation, deterministic=True)
        else:
            action = self.module(observation)
        if not isinstance(action, torch.Tensor) or action.shape[1:] != (2,):
            raise PolicyError("The model gives no actions (n, 2); say by act=... which they are.")
        return action, memory


def export_policy(
    model: Any,  # noqa: ANN401
    path: str | Path,
    env: Any = None,  # noqa: ANN401
    *,
    act: Act | None = None,
) -> Policy:
    """Write what was trained on the environment as a policy, its contract as JSON beside it.

    Normalisation by Gymnasium's ``NormalizeObservation`` and stable-baselines3's ``VecNormalize``
    is taken over as it stands.

    Args:
        model: An algorithm of stable-baselines3 or sb3-contrib, recurrent PPO included, or a torch
            module from observations, (n, size), to deterministic actions, full at -1 and 1, (n, 2).
        path: The file, ``NAME.onnx``.
        env: The environment of the training; by default the algorithm's own.
        act: ``act(model, observations)`` gives the actions of a module that gives something else.

    Returns:
        The policy, as ``load_controller`` gives it.

    Raises:
        UsageError: The environment is not known, or a wrapper changes it.
        PolicyError: The model takes or gives something else.
    """
    chain = list(_layers(model.get_env() if env is None and hasattr(model, "get_env") else env))
    task = getattr(chain[-1], "task", None) if chain else None
    if not isinstance(task, HoppingTask):
        raise UsageError(
            "It is not known on which environment the model was trained; give it as env=..., made"
            " in this process as for the training."
        )
    module = getattr(model, "policy", model)
    actor = _Model(module, act, [e for e in chain if "obs_rms" in vars(e)])
    card = make_card(
        task.robot, task.options, type(model).__name__,
        seed=getattr(model, "seed", None) or 0, steps=int(getattr(model, "num_timesteps", 0)),
        versions=versions("hopping-leg", "stable-baselines3", "torch"),
    )  # fmt: skip
    device, training = next(module.parameters()).device, module.training
    try:
        module.train(False).to("cpu")
        content = build_policy(actor, task.observation, card)
    except RuntimeError as error:
        raise PolicyError(
            f"The model does not take observations (n, {task.observation.size}): {one_line(error)}."
        ) from error
    finally:
        module.train(training).to(device)
    policy = Policy(content, str(path), Path(path).stem)
    policy.set_robot(task.robot)
    policy.save(Path(path))
    return policy


def _layers(env: Any) -> Iterator[Any]:  # noqa: ANN401
    """Yield the wrappers of an environment from outside, then the environment itself."""
    while env is not None:
        kinds = {f"{kind.__module__}.{kind.__name__}" for kind in type(env).__mro__}
        if any(map(_CHANGES.fullmatch, kinds)) and type(env).__name__ not in _HARMLESS:
            raise UsageError(
                f"{type(env).__name__} changes what the network sees or does; do the same in"
                " act=..., and give the environment within as env=...."
            )
        yield env
        within = [vars(env)[name] for name in ("venv", "env") if name in vars(env)]
        env = (within or vars(env).get("envs") or [None])[0]


def convert(content: bytes, path: Path) -> bytes:
    """Return the policy file of a network's; PolicyError says why it cannot be one."""
    beside, told = path.with_suffix(".toml"), Made()
    if beside.is_file():
        tree = parse_toml(beside.read_bytes(), str(beside), PolicyError)
        told = read_dataclass(Made, tree, str(beside), error=PolicyError)
    own = told.robot and told.robot not in shipped_robots()
    robot = load_robot(str(beside.parent / told.robot) if own else told.robot or DEFAULT_ROBOT)
    seen = make_observation(robot, told.options, 1)
    card = make_card(robot, told.options, path.name)
    if not told.robot:
        card = replace(card, robot="", robot_digest="")
    if path.suffix == ".zip":
        return build_policy(_read_sb3(content, str(path), seen.size), seen, card)
    return _wrap(content, str(path), seen, card)


def _read_sb3(content: bytes, origin: str, size: int) -> Actor:
    """Return the actor of a file of stable-baselines3, of whose parts none is unpickled."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            if sum(file.getinfo(part).file_size for part in ("data", "policy.pth")) > _MOST:
                raise PolicyError("it is too large")
            about = json.loads(file.read("data"))
            stored = io.BytesIO(file.read("policy.pth"))
        weights = torch.load(stored, weights_only=True, map_location="cpu")
        told = about["policy_kwargs"]
        options = {name: told[name] for name in _OPTIONS if name in told}
        if about["use_sde"]:
            options["use_sde"] = True
        if "activation_fn" in told:
            name = told["activation_fn"].strip("<>'").split(".")[-1]
            options["activation_fn"] = getattr(nn, name)
        own = [name for name in told if "features_extractor" in name]
        own += ["an LSTM"] * any("lstm" in name for name in weights)
        if own or sum(1 + int(n) for n in re.findall(r"\d+", str(options))) > _WIDEST:
            raise PolicyError(f"it has {', '.join(own) or 'too many neurons'}")
        on_policy = "action_net.weight" in weights
        kind = SACPolicy if "actor.latent_pi.0.weight" in weights else TD3Policy
        spaces = Box(-np.inf, np.inf, (size,)), Box(-1.0, 1.0, (2,))
        policy = (ActorCriticPolicy if on_policy else kind)(*spaces, lambda _: 0.0, **options)
        actor = policy if on_policy else policy.actor
        at = "" if on_policy else "actor."
        named = {n.removeprefix(at): w for n, w in weights.items() if n.startswith(at)}
        actor.load_state_dict(named)
    except Exception as error:  # zipfile, json and torch raise many unrelated types
        made = f"say in {Path(origin).with_suffix('.toml')} what the environment was made with, or "
        raise PolicyError(
            f"{origin} is not read as an actor of stable-baselines3 from {size} observations to two"
            f" actions ({one_line(error)}); {made if 'size mismatch' in str(error) else ''}load it"
            " and use `hopping_leg.export_policy`."
        ) from error
    return _Model(actor)


def _wrap(content: bytes, origin: str, observation: Observation, card: Card) -> bytes:
    """Return a policy file with an ONNX network in the place of its actor."""
    shown = [i.shape for i in open_session(content, origin).get_inputs()]
    if [shape[1:] for shape in shown] != [[observation.size]]:
        raise PolicyError(
            f"{origin} takes {shown}, not observations as [1, {observation.size}]; export it so, or"
            f" tell its environment's options in {Path(origin).with_suffix('.toml')}."
        )
    stand_in = DenseActor(nn.Linear(observation.size, 2))
    model = onnx.load_from_string(build_policy(stand_in, observation, card))
    network = onnx.load_from_string(content)
    graph, opsets = network.graph, network.opset_import
    stored = [helper.make_node("Constant", [], [w.name], value=w) for w in graph.initializer]
    ends, nodes = ([graph.input[0].name], [graph.output[0].name]), [*stored, *graph.node]
    function = helper.make_function(_NETWORK, _NETWORK, *ends, nodes, opsets)
    model.functions.extend([*network.functions, function])
    del model.opset_import[:]
    model.opset_import.extend([*opsets, helper.make_opsetid(_NETWORK, 1)])
    model.ir_version = max(model.ir_version, network.ir_version)
    (linear,) = (node for node in model.graph.node if node.op_type == "Gemm")
    call = helper.make_node(_NETWORK, linear.input[:1], linear.output, domain=_NETWORK)
    linear.CopyFrom(call)
    try:
        wrapped = with_card(model.SerializeToString(), card)
        session, rng = open_session(wrapped, origin), np.random.default_rng(0)
        legs = {i.name: rng.random((2, *i.shape[1:]), np.float32) for i in session.get_inputs()}
        alone = [session.run(None, {k: v[i : i + 1] for k, v in legs.items()})[0] for i in (0, 1)]
        if not np.allclose(session.run(None, legs)[0], np.concatenate(alone), atol=1e-4):
            raise PolicyError("drawn at random, or of several legs together")
    except Exception as error:  # onnx and onnxruntime raise many unrelated types
        raise PolicyError(
            f"{origin} does not give two deterministic actions of each leg ({one_line(error)})."
        ) from error
    return wrapped
