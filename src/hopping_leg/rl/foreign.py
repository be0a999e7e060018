"""Policies of networks that others trained on the environment.

``export_policy`` takes a model in memory. ``convert`` takes files: of a stable-baselines3 ``.zip``
the weights and the JSON alone, as nothing is unpickled, and ONNX networks from observations to
actions. ``NAME.toml`` beside such a file says what the environment was made with, see ``Made``.
"""

import io
import json
import re
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import compose, parser
from torch import nn

from hopping_leg.controllers.observation_history import FULL_TORQUE, make_observation_history
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

_LAYER = re.compile(
    r"(actor\.(latent_pi|mu)|mlp_extractor\.policy_net|action_net)\.(\d+\.)?(weight|bias)"
)
_ELSE = re.compile(r"(actor\.)?log_std|actor_target\.|critic|.*value_net")
"""Weights of stable-baselines3's actors, and those that deterministic actions do not depend on."""

_MOST = 1 << 29  # bytes of an actor
_ACTIVATIONS = ("Tanh", "ReLU", "ELU", "LeakyReLU", "SiLU", "GELU", "Sigmoid")

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

    def __init__(self, module: Any, act: Act | None, layers: list[Any]) -> None:  # noqa: ANN401
        super().__init__()
        self.module, self._layers = module, layers
        self._act = act or _act
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
        if not self._lstm:
            return self._act(self.module, observation), memory
        shape = (-1, 2, self._lstm.num_layers, self._lstm.hidden_size)
        h, c = memory.reshape(shape).permute(1, 2, 0, 3)
        seen = self.module.pi_features_extractor(observation)[None]
        told, state = self._lstm(seen, (h.contiguous(), c.contiguous()))
        action = self.module.action_net(self.module.mlp_extractor.forward_actor(told[0]))
        return action, torch.stack(state).permute(2, 0, 1, 3).flatten(1)


def _act(module: Any, observation: torch.Tensor) -> Any:  # noqa: ANN401
    """Return the actions of a policy of stable-baselines3, or what another module gives."""
    if hasattr(module, "_predict"):
        return module._predict(observation, deterministic=True)
    return module(observation)


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
        with torch.no_grad():
            seen = torch.zeros(1, task.observation.size)
            action, _ = actor(seen, torch.zeros(1, actor.memory_size))
        if not isinstance(action, torch.Tensor) or action.shape != (1, 2):
            raise PolicyError("The model gives no actions (n, 2); say by act=... which they are.")
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


def _read_sb3(content: bytes, origin: str, size: int) -> DenseActor:
    """Return the actor of a file of stable-baselines3, of whose parts none is unpickled."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as file:
            if sum(file.getinfo(part).file_size for part in ("data", "policy.pth")) > _MOST:
                raise PolicyError("it is too large")
            about = json.loads(file.read("data"))
            stored = io.BytesIO(file.read("policy.pth"))
        weights = torch.load(stored, weights_only=True, map_location="cpu")
        options = about["policy_kwargs"]
        unknown = [n for n in weights if not _LAYER.fullmatch(n) and not _ELSE.match(n)]
        unknown += [name for name in options if "features_extractor_" in name]
        on_policy = "action_net.weight" in weights
        named = str(options.get("activation_fn", "Tanh" if on_policy else "ReLU"))
        activation = named.strip("<>'").rpartition(".")[2] or named
        if unknown or activation not in _ACTIVATIONS:
            raise PolicyError(f"it has {', '.join([*unknown, activation][:2])}")
        last: list[nn.Module] = []
        if options.get("use_sde") and not on_policy:
            last = [nn.Hardtanh(-(most := float(options.get("clip_mean", 2.0))), most)]
        if not on_policy or options.get("squash_output"):
            last.append(nn.Tanh())
        linear, layers = [w for n, w in weights.items() if _LAYER.fullmatch(n)], list[nn.Module]()
        for weight, bias in zip(linear[::2], linear[1::2], strict=True):
            layers += [nn.Linear(*weight.shape[::-1]), getattr(nn, activation)()]
            layers[-2].load_state_dict({"weight": weight, "bias": bias})
        actor = DenseActor(*layers[:-1], *last)
        with torch.no_grad():
            actor(torch.zeros(1, size), torch.zeros(1, 0))[0].reshape(1, 2)
    except Exception as error:  # zipfile, json and torch raise many unrelated types
        raise PolicyError(
            f"{origin} is not read as an actor of stable-baselines3 from {size} observations to two"
            f" actions ({one_line(error)}); say in {Path(origin).with_suffix('.toml')} what the"
            " environment was made with, or load it and use `hopping_leg.export_policy`."
        ) from error
    return actor


def _wrap(content: bytes, origin: str, observation: Observation, card: Card) -> bytes:
    """Return a policy file around an ONNX network from observations, (n, size), to actions."""
    shown = {i.name: tuple(i.shape[1:]) for i in open_session(content, origin).get_inputs()}
    size, history = observation.size, make_observation_history(card.layout, 1 / card.rate)
    if list(shown.values()) != [(size,)]:
        raise PolicyError(
            f"{origin} takes {list(shown.values())}, not one observation of {size} numbers; where"
            f" its environment had options, tell them in {Path(origin).with_suffix('.toml')}."
        )
    model, names = onnx.load_from_string(content), history.network_inputs
    network = compose.add_prefix(model, "network.").graph
    place, scaling = np.argsort(observation.order), observation.scaling
    inputs = ", ".join(
        f"float[n,{str(s)[1:-1].rstrip(',')}] {k}" for k, s in history.shapes.items()
    )
    around = parser.parse_graph(f"""policy ({inputs}) => (float[n,2] torque) <
        int64[{size}] place = {_list(place)}, float[2] full = {_list(card.torque_scale)},
        float[{size}] offset = {_list(scaling.offset[place])},
        float[{size}] gain = {_list(scaling.gain[place])}, float least = {{-1}},
        float most = {{1}}> {{
        {"".join(f"flat_{name} = Flatten ({name}) " for name in names)}
        joined = Concat <axis = 1> ({", ".join(f"flat_{name}" for name in names)})
        placed = Gather <axis = 1> (joined, place)
        centred = Sub (placed, offset)
        seen = Mul (centred, gain)
        clipped = Clip (action, least, most)
        torque = Mul (clipped, {FULL_TORQUE if FULL_TORQUE in history.shapes else "full"}) }}""")
    *before, clip, scale = around.node
    before[-1].output[0], clip.input[0] = network.input[0].name, network.output[0].name
    nodes = [*before, *network.node, clip, scale]
    del around.node[:]
    around.node.extend(nodes)
    around.initializer.extend(network.initializer)
    model.graph.CopyFrom(around)
    try:
        wrapped = with_card(model.SerializeToString(), card)
        session, rng = open_session(wrapped, origin), np.random.default_rng(0)
        legs = {k: rng.random((2, *shape), np.float32) for k, shape in history.shapes.items()}
        alone = [session.run(None, {k: v[i : i + 1] for k, v in legs.items()})[0] for i in (0, 1)]
        if not np.allclose(session.run(None, legs)[0], np.concatenate(alone), atol=1e-4):
            raise PolicyError("drawn at random, or of several legs together")
    except Exception as error:  # onnx and onnxruntime raise many unrelated types
        raise PolicyError(
            f"{origin} does not give two deterministic actions of each leg ({one_line(error)})."
        ) from error
    return wrapped


def _list(values: Any) -> str:  # noqa: ANN401
    return f"{{{', '.join(map(repr, np.asarray(values).tolist()))}}}"
