import builtins
import os
import signal

import pytest

from hopping_leg.cluster import RayCluster
from hopping_leg.errors import PhysicsError, UsageError
from tests.clusters import local, two_machines


def double(number):
    return 2 * number


def blow_up(number):
    raise PhysicsError(f"Simulation {number} blew up.")


def die_once(mark):
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "lived"


@pytest.mark.slow
def test_results_come_in_the_order_of_the_arguments_and_errors_as_they_were_raised():
    pytest.importorskip("ray", reason="Ray is not installed (extra 'cluster')")
    with local():
        cluster = RayCluster("local")
        assert cluster.cores == 2
        assert cluster.elsewhere == []
        assert cluster.map(double, ((k,) for k in range(20))) == list(range(0, 40, 2))
        with pytest.raises(PhysicsError) as caught:
            cluster.map(blow_up, [(7,)])
        assert str(caught.value) == "Simulation 7 blew up."
        assert type(caught.value) is PhysicsError


@pytest.mark.slow
def test_a_worker_that_dies_begins_again(tmp_path):
    pytest.importorskip("ray", reason="Ray is not installed (extra 'cluster')")
    with local():
        assert RayCluster().map(die_once, [(tmp_path / "mark",)]) == ["lived"]


@pytest.mark.slow
def test_an_address_is_joined():
    pytest.importorskip("ray", reason="Ray is not installed (extra 'cluster')")
    with two_machines() as address:
        assert RayCluster(address).cores == 2


@pytest.mark.parametrize("address", ["127.0.0.1:1", "ray://127.0.0.1:1"])
def test_where_no_cluster_answers_there_is_a_sentence_at_once(address):
    ray = pytest.importorskip("ray", reason="Ray is not installed (extra 'cluster')")
    ray.shutdown()
    with pytest.raises(UsageError, match=rf"no Ray cluster at {address}: .*; start one"):
        RayCluster(address)


def test_without_ray_there_is_a_sentence(monkeypatch):
    real = builtins.__import__

    def refuse(name, *rest, **more):
        if name == "ray":
            raise ModuleNotFoundError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(UsageError, match=r"hopping-leg\[cluster\]"):
        RayCluster()
