"""Test set-up shared by all rooms."""

import pytest
from hypothesis import settings

settings.register_profile("steady", deadline=None, derandomize=True)
settings.load_profile("steady")


@pytest.fixture(autouse=True, scope="session")
def learners_log_where_tests_do(tmp_path_factory):
    """Keep stable-baselines3, which logs unless told otherwise, out of the system's folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SB3_LOGDIR", str(tmp_path_factory.mktemp("logs")))
        yield
