"""MPC: simulate the rest of the hop, choose the push-off that reaches the apex."""

from hopping_leg.controllers.mpc.true_state import HopShape, Planning, TrueStateMpc

__all__ = ["HopShape", "Planning", "TrueStateMpc"]
