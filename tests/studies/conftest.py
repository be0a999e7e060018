"""Fixtures that studies share with the evaluation's tests."""

from tests.evaluate.conftest import judged, robot, setup, spring

__all__ = ["judged", "robot", "setup", "spring"]
