"""Emulate a leg with its two drives behind a real wire, for `hop deploy` and `hop doctor`.

The emulator offers a serial terminal which the moteus client takes for an fdcanusb, or a CAN bus of
python-can. Behind it two drives, with their own mode machines, watchdogs and limits, turn the
simulated leg in real time. Ends with Ctrl-C.

Examples:
  hop emulate --robot legv2
  hop deploy fast --transport /dev/pts/5        # in another terminal, with the path printed here
  hop emulate --robot twin --faults faults.toml --link /tmp/leg
  hop emulate --interface udp_multicast
  hop emulate --no-homed --no-configured        # as a leg that was just put together

A fault script is TOML; `hop emulate --kinds` lists what it may name:
  [[fault]]
  kind = "late_reply"
  since = "flight"
  at = 2.0
  drive = "knee"
  value = 0.012
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.table import Table

from hopping_leg.emulator.faults import KINDS
from hopping_leg.errors import UsageError


@dataclass(frozen=True)
class Emulate:
    """What is emulated and how the host reaches it."""

    robot: str = "legv2"
    """A shipped robot or a .toml file; its [reality] stands behind the wire, too."""
    start_pose: str = "stand"
    """stand, crouch, stretch, zero (straight down), or joint angles as HIP,KNEE in rad."""
    faults: Path | None = None
    """TOML script of what goes wrong, and when."""
    interface: Literal["pty", "udp_multicast", "socketcan"] = "pty"
    """pty is a serial terminal like an fdcanusb's; the others are buses of python-can."""
    channel: str | None = None
    """Of a CAN bus: multicast group or interface name; default 239.74.163.2 or vcan0."""
    link: Path | None = None
    """Also offer the terminal under this path, which stays the same when it is plugged again."""
    configured: bool = True
    """Drives configured as the robot's file asks; else as their firmware is delivered."""
    homed: bool = True
    """Drives homed by hand; else they know their position within a turn of the rotor only."""
    held: bool = True
    """Somebody holds the leg until both drives are powered."""
    seed: int = 0
    """Of sensor noise and jitter."""
    realtime: bool = True
    """Take real-time priority where that is permitted, so that the drives answer in time."""
    seconds: float | None = None
    """End by itself after this time; default: with Ctrl-C."""
    kinds: bool = False
    """List the kinds of faults and end."""


def run(args: Emulate) -> None:
    """Serve the emulated robot until Ctrl-C."""
    console = Console(highlight=False)
    if args.kinds:
        _list_kinds(console)
        return
    if args.seed < 0:
        raise UsageError(f"A seed of {args.seed} has no meaning; give 0 or more.")
    from hopping_leg.cli.emulating import emulate

    emulate(args, console)


def _list_kinds(console: Console) -> None:
    table = Table("kind", "what happens", "value", "unit", "lasts")
    for name, kind in KINDS.items():
        if math.isnan(kind.duration):
            lasts = "so many replies"
        else:
            lasts = "on" if math.isinf(kind.duration) else f"{kind.duration:g} s"
        table.add_row(name, kind.text, f"{kind.value:g}" if kind.unit else "", kind.unit, lasts)
    console.print(table)
