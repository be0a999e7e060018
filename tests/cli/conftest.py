import pytest

from hopping_leg.cli import FAILED, main
from hopping_leg.evaluate import Entry
from tests.evaluate.conftest import Spring


@pytest.fixture
def spring(monkeypatch):
    """Every controller that is named is a spring made for 0.29 to 0.31 m."""

    def load(names, robot, rate):
        return [Entry(name, Spring(robot, (0.29, 0.31))) for name in names]

    monkeypatch.setattr("hopping_leg.evaluate.runner.load_entries", load)


@pytest.fixture
def refused(capsys):
    """Return a function that calls `hop` and expects exit code 2 and a sentence on stderr."""

    def call(words, sentence):
        try:
            code, begins = main([str(word) for word in words]), "hop: "
        except SystemExit as ended:  # of what parses the words
            code, begins = ended.code, ""
        said = capsys.readouterr().err
        assert code == FAILED
        assert said.splitlines()[-1].startswith(begins)
        assert sentence in " ".join(said.replace("\u2502", "").split())

    return call
