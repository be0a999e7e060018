"""Take the deterministic actor out of a stable-baselines3 model."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from hopping_leg.arrays import Array
from hopping_leg.envs.observation import Observation
from hopping_leg.errors import UsageError
from hopping_leg.rl.distillation.adaptive_student import AdaptiveStudent
from hopping_leg.rl.memories import CommandIntegrator, RecurrentUnit
from hopping_leg.rl.onnx_export import Network

_NAMES = {nn.ReLU: "relu", nn.Tanh: "tanh", nn.ELU: "elu"}


def network_of(model: BaseAlgorithm, observation: Observation) -> Network:
    """Return a model's actor with the task's normalisation, for the observation's layout.

    Args:
        model: SAC, or PPO with separate networks of plain layers.
        observation: Of the task it learns.

    Raises:
        UsageError: The actor is no stack of dense layers.
    """
    if isinstance(model, SAC):
        return dense_network([model.actor.latent_pi, model.actor.mu], observation, "tanh")
    policy = model.policy
    return dense_network([policy.mlp_extractor.policy_net, policy.action_net], observation, "clip")


def dense_network(parts: Sequence[nn.Module], observation: Observation, squash: str) -> Network:
    """Return dense layers with the task's normalisation, for the observation's layout.

    Args:
        parts: Layers and activations in order, or modules of such.
        observation: Of the task.
        squash: How the output is brought to -1..1.

    Raises:
        UsageError: They are no stack of dense layers.
    """
    modules = [leaf for part in parts for leaf in _flatten(part)]
    bound = float("inf")
    if isinstance(modules[-1], nn.Hardtanh):
        bound = float(modules[-1].max_val)
        modules = modules[:-1]
    layers = [_weights(m) for m in modules if isinstance(m, nn.Linear)]
    kinds = {type(m) for m in modules} - {nn.Linear}
    if len(kinds) != 1 or not kinds <= _NAMES.keys():
        raise UsageError(
            f"An actor of {sorted(k.__name__ for k in kinds)} cannot be exported; use dense layers"
            f" with one of {', '.join(_NAMES.values())}."
        )
    layers[0] = (layers[0][0][:, observation.order], layers[0][1])
    scaling = observation.scaling
    return Network(scaling.offset, scaling.gain, layers, _NAMES[kinds.pop()], squash, bound)


def recurrent_network(
    unit: nn.GRU, parts: Sequence[nn.Module], observation: Observation, squash: str
) -> Network:
    """Return dense layers behind a gated recurrent unit, as ``dense_network`` does."""
    with torch.no_grad():
        weights = [w.double().numpy().copy() for w in unit.all_weights[0]]
    scaling = observation.scaling
    weights[0] = weights[0][:, observation.order]
    layers = [_weights(m) for part in parts for m in _flatten(part) if isinstance(m, nn.Linear)]
    return Network(
        scaling.offset, scaling.gain, layers, "tanh", squash, memory=RecurrentUnit(*weights)
    )


def adaptive_network(student: AdaptiveStudent, observation: Observation, squash: str) -> Network:
    """Return a student that remembers where to aim, as ``dense_network`` does."""
    network = dense_network([student.layers], observation, squash)
    layers = [_weights(m) for m in _flatten(student.feeling) if isinstance(m, nn.Linear)]
    order = np.append(observation.order, observation.size)
    layers[0] = (layers[0][0][:, order], layers[0][1])
    command_integrator = student.command_integrator
    aim = CommandIntegrator(
        layers,
        rate=student.rate * command_integrator.scale,
        most=command_integrator.most,
        farthest=command_integrator.farthest,
        beyond=command_integrator.beyond,
        follow=student.follow,
    )
    return dataclasses.replace(network, memory=aim)


def _flatten(module: nn.Module) -> list[nn.Module]:
    if isinstance(module, nn.Sequential):
        return [leaf for child in module for leaf in _flatten(child)]
    return [module]


def _weights(layer: nn.Linear) -> tuple[Array, Array]:
    with torch.no_grad():
        return layer.weight.double().numpy(), layer.bias.double().numpy()
