"""The Controller protocol and what implements it."""

from hopping_leg.controllers.protocol import Controller
from hopping_leg.controllers.rollout import Rollout, RolloutConfig, rollout

__all__ = ["Controller", "Rollout", "RolloutConfig", "rollout"]
