"""The Controller protocol and what implements it."""

from hopping_leg.control.protocol import Controller
from hopping_leg.control.rollout import Rollout, Setup, roll_out

__all__ = ["Controller", "Rollout", "Setup", "roll_out"]
