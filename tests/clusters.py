"""Ray clusters on this machine."""

import contextlib


@contextlib.contextmanager
def local(**options):
    """Join a Ray of two CPUs on this machine for a while."""
    import ray

    ray.shutdown()
    ray.init(num_cpus=2, log_to_driver=False, **options)
    try:
        yield
    finally:
        ray.shutdown()


@contextlib.contextmanager
def two_machines():
    """Run what is to Ray two machines of one CPU each; give their address."""
    import ray
    from ray.cluster_utils import Cluster

    ray.shutdown()
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    cluster.add_node(num_cpus=1)
    try:
        yield cluster.address
    finally:
        ray.shutdown()
        cluster.shutdown()
