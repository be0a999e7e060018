"""The Controller protocol and what implements it."""

from hopping_leg.controllers.protocol import Controller
from hopping_leg.controllers.rollout import Rollout, Setup, roll_out

__all__ = ["Controller", "Rollout", "Setup", "roll_out"]
