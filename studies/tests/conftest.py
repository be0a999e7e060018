"""Fixtures that the studies' tests share with the package's."""

from tests.evaluate.conftest import judged, robot, setup, spring

from tests.conftest import learners_log_where_tests_do

__all__ = ["judged", "learners_log_where_tests_do", "robot", "setup", "spring"]
