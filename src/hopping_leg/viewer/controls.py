"""Inputs that every kind of viewer has: pause, single step, speed."""

import viser

from hopping_leg.viewer.inbox import Inbox
from hopping_leg.viewer.pace import SPEEDS, Pace

STEP_TICKS = 1
"""Control periods of a single step."""


class TimeControls:
    """Pause, step and speed, by buttons and keys.

    Args:
        server: Of the page.
        inbox: For what is asked.
        pace: To be changed.
    """

    def __init__(self, server: viser.ViserServer, inbox: Inbox, pace: Pace) -> None:
        self._pace = pace
        gui = server.gui
        self._pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE, hint="Space")
        step = gui.add_button("Single step", icon=viser.Icon.PLAYER_SKIP_FORWARD, hint="Key S")
        names = tuple(f"{speed:g}" for speed in SPEEDS)
        speed = gui.add_dropdown("Speed", names, initial_value="1", hint="1 is real time")
        self._pause.on_click(inbox.from_page(self.pause))
        step.on_click(inbox.from_page(self.step))
        speed.on_update(inbox.from_page(lambda: pace.set_speed(float(speed.value))))
        keys = (("Pause or go on", "space", self.pause), ("Single step", "S", self.step))
        for label, key, wish in keys:
            gui.add_command(label, hotkey=key).on_trigger(inbox.from_keys(wish))  # type: ignore[arg-type]

    def pause(self) -> None:
        """Pause, or go on."""
        self._pace.paused = not self._pace.paused
        self._label()

    def step(self) -> None:
        """Pause, and show one control period more."""
        self._pace.step(STEP_TICKS)
        self._label()

    def _label(self) -> None:
        paused = self._pace.paused
        self._pause.label = "Go on" if paused else "Pause"
        self._pause.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE
