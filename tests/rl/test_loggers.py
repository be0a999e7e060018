import sys
from types import SimpleNamespace

import pytest

from hopping_leg import cli
from hopping_leg.errors import UsageError
from hopping_leg.rl.loggers import make_logger


class Fake(SimpleNamespace):
    """A package that remembers what it was told."""

    def __init__(self):
        super().__init__(begun=[], rows=[], finished=0)

    def init(self, **options):
        self.begun.append(options)

    def log(self, numbers, step):
        self.rows.append((step, numbers))

    def finish(self):
        self.finished += 1


@pytest.fixture
def fake(monkeypatch, request):
    name, module = getattr(request, "param", "wandb"), Fake()
    monkeypatch.setitem(sys.modules, name, module)
    return name, module


@pytest.mark.parametrize("fake", ["wandb", "trackio"], indirect=True)
def test_numbers_reach_the_package_and_texts_do_not(fake, tmp_path):
    name, module = fake
    logger = make_logger(tmp_path / "run", name, {"recipe": "fast", "seed": 3})
    logger.record("trial/score_m", 0.004)
    logger.record("note", "hello")
    logger.dump(64)
    logger.close()
    assert module.rows == [(64, {"trial/score_m": 0.004})]
    assert module.finished == 1
    assert module.begun[0]["name"] == "run"
    assert module.begun[0]["config"] == {"recipe": "fast", "seed": 3}
    assert list((tmp_path / "run" / "tensorboard").iterdir())


def test_a_resumed_run_goes_on_under_its_identity(fake, tmp_path):
    name, module = fake
    for folder in ("one", "one", "two"):
        make_logger(tmp_path / folder, name, {}).close()
    first, again, other = (options["id"] for options in module.begun)
    assert first == again != other


def test_a_package_that_does_not_start_is_a_sentence(fake, tmp_path):
    name, module = fake

    def refuse(**_):
        raise RuntimeError("no login\nlong advice")

    module.init = refuse
    with pytest.raises(UsageError, match="wandb did not start: no login; set it up"):
        make_logger(tmp_path, name, {})


@pytest.mark.parametrize("package", ["wandb", "trackio"])
def test_a_missing_package_is_named_before_anything_is_written(
    package, tmp_path, monkeypatch, capsys
):
    monkeypatch.setitem(sys.modules, package, None)
    out = tmp_path / "run"
    assert cli.main(["train", "--log", package, "--out", str(out)]) == cli.FAILED
    assert f"pip install {package}" in capsys.readouterr().err
    assert not out.exists()
