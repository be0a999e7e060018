"""Shooting: simulate the rest of the hop, choose the push-off that reaches the apex."""

from hopping_leg.controllers.shooting.controller import HopShape, Planning, Shooting

__all__ = ["HopShape", "Planning", "Shooting"]
