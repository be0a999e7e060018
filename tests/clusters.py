"""Ray clusters on this machine, one at a time: two that start together take each other's ports."""

import contextlib
import tempfile
from pathlib import Path

import pytest

NONE = "Ray is not installed (extra 'cluster')"
_LOCK = Path(tempfile.gettempdir()) / "hopping-leg-tests-ray.lock"


@contextlib.contextmanager
def local(**options):
    """Join a Ray of two CPUs on this machine for a while."""
    ray = pytest.importorskip("ray", reason=NONE)
    from filelock import FileLock

    with FileLock(_LOCK):
        ray.shutdown()
        ray.init(address="local", num_cpus=2, log_to_driver=False, **options)
        try:
            yield
        finally:
            ray.shutdown()


@contextlib.contextmanager
def two_machines():
    """Run what is to Ray two machines of one CPU each; give their address."""
    ray = pytest.importorskip("ray", reason=NONE)
    from filelock import FileLock
    from ray.cluster_utils import Cluster

    with FileLock(_LOCK):
        ray.shutdown()
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
        cluster.add_node(num_cpus=1)
        try:
            yield cluster.address
        finally:
            ray.shutdown()
            cluster.shutdown()
