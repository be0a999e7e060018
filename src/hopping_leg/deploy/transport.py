"""Which adapter: the path of an fdcanusb, a python-can interface, or a pi3hat."""

import argparse
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hopping_leg.errors import HardwareError, UsageError

Opener = Callable[[], Any]
"""Makes a ``moteus.Transport``; must be called inside of a running event loop."""

_FORMS = (
    "the path of an fdcanusb (e.g. /dev/serial/by-id/...), interface:channel of python-can"
    " (e.g. socketcan:can0), or pi3hat"
)


def opener(name: str) -> Opener:
    """Return what opens a transport.

    Args:
        name: As on the command line.

    Raises:
        UsageError: It names no transport.
        HardwareError: What it needs is not installed.
    """
    require_moteus()
    if name == "pi3hat":
        return _open_pi3hat
    if "/" in name:
        if not Path(name).exists():
            raise UsageError(f"There is no serial port {name}; give {_FORMS}.")
        return lambda: _open_serial(name)
    interface, colon, channel = name.partition(":")
    if not (interface and colon and channel):
        raise UsageError(f"There is no transport '{name}'; give {_FORMS}.")
    _check_interface(interface)
    return lambda: _open_can(interface, channel)


def require_moteus() -> None:
    """Refuse to go on without the client library.

    Raises:
        HardwareError: It is not installed.
    """
    try:
        importlib.import_module("moteus")
    except ModuleNotFoundError as error:
        raise HardwareError(
            f"Motors need {error.name}, which comes with the hardware extra:"
            " pip install 'hopping-leg[hardware]'."
        ) from error


def _check_interface(interface: str) -> None:
    can: Any = importlib.import_module("can")
    if interface not in can.VALID_INTERFACES:
        valid = ", ".join(sorted(can.VALID_INTERFACES))
        raise UsageError(f"python-can has no interface '{interface}'; it has: {valid}.")


def _open_serial(path: str) -> Any:  # noqa: ANN401
    from moteus import Transport

    from hopping_leg.deploy.fdcanusb import TolerantFdcanusb

    return Transport([TolerantFdcanusb(path)])


def _open_can(interface: str, channel: str) -> Any:  # noqa: ANN401
    from moteus import PythonCanDevice, Transport

    return Transport([PythonCanDevice(interface=interface, channel=channel, fd=True)])


def _open_pi3hat() -> Any:  # noqa: ANN401
    from moteus import Transport
    from moteus.transport_factory import get_transport_factories

    for factory in get_transport_factories():
        if factory.name == "pi3hat":
            parser = argparse.ArgumentParser()
            factory.add_args(parser)
            return Transport(factory(parser.parse_args([])))
    raise HardwareError(
        "The pi3hat needs moteus-pi3hat, which exists for the Raspberry Pi alone:"
        " pip install 'hopping-leg[pi3hat]'."
    )
