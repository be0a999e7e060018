"""Emulate a leg with its two drives behind a real wire, for `hop deploy` and `hop doctor`.

The emulator offers a serial terminal which the moteus client takes for an fdcanusb. Behind it two
drives, with their own mode machines, watchdogs and limits, turn the simulated leg in real time.
Ends with Ctrl-C.

Examples:
  hop emulate --robot legv2
  hop deploy fast --transport /dev/pts/5        # in another terminal, with the path printed here
  hop emulate --robot twin --faults faults.toml --link /tmp/leg
  hop emulate --no-homed --no-configured        # as a leg that was just put together

A fault script is TOML; `hop emulate --kinds` lists what it may name:
  [[fault]]
  kind = "late_reply"
  since = "flight"
  at = 2.0
  drive = "knee"
  value = 0.012
"""

import contextlib
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hopping_leg.cli.options import at_least, say, show_table
from hopping_leg.deploy.drive_link import DriveMode, FaultCode
from hopping_leg.deploy.realtime import prefer_this_process, uninterrupted
from hopping_leg.emulator.faults import KINDS, load_faults
from hopping_leg.emulator.mode_machine import Notice
from hopping_leg.robot import DEFAULT_ROBOT, JOINTS

if TYPE_CHECKING:
    from hopping_leg.emulator.robot import EmulatedRobot


@dataclass(frozen=True)
class Emulate:
    """What is emulated and how the host reaches it."""

    robot: str = DEFAULT_ROBOT
    """A shipped robot or a .toml file; its [reality] stands behind the wire, too."""
    start_pose: tuple[str, ...] = ("stand",)
    """stand, zero (straight down), or angles of hip and knee, rad."""
    faults: Path | None = None
    """TOML script of faults and their times."""
    link: Path | None = None
    """Also offer the terminal under this path, which stays the same when it is plugged again."""
    configured: bool = True
    """Drives configured for the robot's file; --no-configured: as delivered."""
    homed: bool = True
    """Drives homed by hand; --no-homed: they know their position within a rotor's turn."""
    held: bool = True
    """Hold the leg until both drives are powered, and once they are off; --no-held: let it fall."""
    seed: int = 0
    """Seed of sensor noise and jitter."""
    realtime: bool = True
    """Take real-time priority where permitted, to answer in time; --no-realtime: do not."""
    seconds: float = math.inf
    """Time after which the emulator ends, s, if not with Ctrl-C."""
    kinds: bool = False
    """List the kinds of faults and end."""


def run(args: Emulate) -> None:
    """Serve the emulated robot until it is over, and tell what happens."""
    if args.kinds:
        rows, words = [], {"inf": "on", "nan": "so many replies"}
        for name, kind in KINDS.items():
            lasts = words.get(f"{kind.duration:g}", f"{kind.duration:g} s")
            rows.append((name, kind.text, f"{kind.value:g}" if kind.unit else "", kind.unit, lasts))
        show_table(("kind", "what happens", "value", "unit", "lasts"), rows)
        return
    at_least(0, seed=args.seed)
    from hopping_leg.emulator.ports import PtyPort
    from hopping_leg.emulator.server import EmulatorConfig, Server

    start = EmulatorConfig(
        robot=args.robot, pose=",".join(args.start_pose), configured=args.configured,
        homed=args.homed, held=args.held, seed=args.seed,
        faults=() if args.faults is None else load_faults(args.faults),
    )  # fmt: skip
    robot, port = start.build(), PtyPort(args.link)
    robot.patience = 1.0 if args.held else math.inf
    with contextlib.closing(port), contextlib.suppress(KeyboardInterrupt):
        ids = " and ".join(str(drive.id) for drive in robot.drives)
        say(f"Drives {ids} of {robot.robot.name} behind {port}")
        sys.stdout.flush()
        if args.realtime and prefer_this_process() is not None:
            say("Without real-time priority the drives may answer late under load.")
        server = Server(robot, port)
        server.on_turn = _Events(robot).tell
        with uninterrupted():
            server.run(lambda: robot.time >= args.seconds)
    say(f"The emulator ended after {robot.time:.1f} s.")


class _Events:
    def __init__(self, robot: "EmulatedRobot") -> None:
        self._robot, self._faults_shown, self._held = robot, 0, robot.held
        self._modes = [drive.machine.mode for drive in robot.drives]

    def tell(self) -> None:
        """Print what is new."""
        log, before = self._robot.fault_injector.log, self._modes
        for begun, fault in log[self._faults_shown :]:
            who = "" if fault.kind == "unplug" else f" ({fault.drive})"
            print(f"{begun:7.3f} s  fault: {KINDS[fault.kind].text}{who}", flush=True)
        self._faults_shown = len(log)
        held, self._held = self._held, self._robot.held
        if self._held > held:
            print(f"{self._robot.time:7.3f} s  leg: brought back and held", flush=True)
        self._modes = [drive.machine.mode for drive in self._robot.drives]
        for name, old, drive in zip(JOINTS, before, self._robot.drives, strict=True):
            mode = drive.machine.mode
            if mode is not old:
                code, text = drive.machine.fault, mode.name
                if mode is DriveMode.FAULT:
                    known = [kind(code).name for kind in (FaultCode, Notice) if code in set(kind)]
                    text = f"{text} {code}: {known[0] if known else 'unknown'}"
                text = text.lower().replace("_", " ")
                print(f"{self._robot.time:7.3f} s  {name}: {text}", flush=True)
