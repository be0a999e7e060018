import pytest

from hopping_leg.viewer import scene


@pytest.fixture
def linux(monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")


@pytest.mark.parametrize("device", ["dri/renderD128", "nvidia0", "dxg"])
def test_a_device_that_draws_is_seen(device, tmp_path, linux):
    assert not scene.has_gpu(tmp_path)
    (tmp_path / device).parent.mkdir(exist_ok=True)
    (tmp_path / device).touch()
    assert scene.has_gpu(tmp_path)


def test_other_systems_always_have_one(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.platform", "darwin")
    assert scene.has_gpu(tmp_path)


@pytest.mark.parametrize(("gpu", "detail"), [(True, None), (False, scene.COARSE)])
def test_only_a_processor_is_spared_pixels(gpu, detail, monkeypatch):
    monkeypatch.setattr(scene, "has_gpu", lambda: gpu)
    assert scene.pixel_ratio() == detail
