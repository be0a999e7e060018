"""Fixtures that studies share with the evaluation's tests."""

from tests.evaluate.conftest import robot, setup, spring

__all__ = ["robot", "setup", "spring"]
