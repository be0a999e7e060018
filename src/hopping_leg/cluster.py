"""A Ray cluster: how it is reached, what it is asked, what comes back."""

import socket
from collections.abc import Callable, Iterable
from typing import Any

from hopping_leg.errors import HoppingLegError, UsageError

_PATIENCE = 5.0
"""How long an address may take to answer, s."""


class RayCluster:
    """The Ray cluster at an address; one that this process has joined already stays the one.

    Args:
        address: Of the cluster; ``local`` or None starts one on this machine, which ends with this
            process.

    Raises:
        UsageError: Ray is not installed or the cluster cannot be reached.
    """

    def __init__(self, address: str | None = None) -> None:
        self._ray = _import_ray()
        if not self._ray.is_initialized():
            try:
                _knock(address)
                self._ray.init(address=address or "local", log_to_driver=False)
            except (OSError, ValueError, RuntimeError) as error:
                raise UsageError(_unreached(address, str(error).rstrip("."))) from error

    @property
    def cores(self) -> int:
        """CPUs of all its machines."""
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    @property
    def elsewhere(self) -> list[str]:
        """Names of its machines other than this one."""
        names = {n["NodeManagerHostname"] for n in self._ray.nodes() if n["Alive"]}
        return sorted(names - {socket.gethostname()})

    def put(self, value: object) -> object:
        """Send a value to the cluster once; as an argument of tasks it stands for the value."""
        return self._ray.put(value)

    def map(self, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]) -> list[Any]:
        """Call a function once per tuple of arguments, one CPU each; return what they return.

        A task whose process or machine dies is begun again a few times.

        Raises:
            HoppingLegError: Of a task, as it was raised there.
            UsageError: Workers died again and again.
        """
        exceptions = self._ray.exceptions
        task = self._ray.remote(_call)
        try:
            return list(self._ray.get([task.remote(function, *values) for values in arguments]))
        except exceptions.RayTaskError as error:
            if isinstance(error.cause, HoppingLegError):
                raise error.cause from None
            raise
        except exceptions.RayError as error:
            raise UsageError(
                f"A worker of the Ray cluster died: {str(error).splitlines()[0].rstrip('.')}; call"
                " the same command again to go on."
            ) from error


def _call(function: Callable[..., Any], *values: Any) -> Any:  # noqa: ANN401
    return function(*values)


def _unreached(address: str | None, why: str) -> str:
    if address in (None, "local"):
        return f"Ray does not start on this machine: {why}; name a cluster by its address instead."
    return (
        f"There is no Ray cluster at {address}: {why}; start one with `ray start --head`, or leave"
        " the address out."
    )


def _knock(address: str | None) -> None:
    """Fail at once where nothing answers; Ray itself would try for minutes.

    Raises:
        OSError: Nothing answers at an address of the form ``host:port``.
    """
    host, _, port = (address or "").removeprefix("ray://").rpartition(":")
    if host and port.isdigit():
        socket.create_connection((host, int(port)), _PATIENCE).close()


def _import_ray() -> Any:  # noqa: ANN401
    try:
        import ray
    except ModuleNotFoundError as error:
        raise UsageError(
            "A cluster needs Ray; install it with `pip install 'hopping-leg[cluster]'`."
        ) from error
    return ray
