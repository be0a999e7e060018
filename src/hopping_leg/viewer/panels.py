"""Inputs of the page, what carries them to the thread that simulates, the clock of the pictures."""

from collections.abc import Callable, Collection, Coroutine
from queue import SimpleQueue
from typing import Any

import viser

from hopping_leg.controllers.registry import controller_names
from hopping_leg.errors import HoppingLegError, UsageError
from hopping_leg.io import one_line
from hopping_leg.robot import load_robot, shipped_robots
from hopping_leg.viewer import live_leg, tracks
from hopping_leg.viewer.live_leg import Range

Action = Callable[[], object]


def chosen(handle: Any, offered: Collection[str]) -> str:  # noqa: ANN401
    """Return a choice of the page; UsageError where it was not offered, e.g. a path."""
    if handle.value not in offered:
        raise UsageError(f"The page sent {one_line(handle.value)}, which it does not offer.")
    return str(handle.value)


class Inputs:
    """Adds inputs and keys to the page; what they ask for waits for the thread that simulates."""

    def __init__(self, server: viser.ViserServer) -> None:
        self.gui: Any = server.gui
        self._asked: SimpleQueue[Action] = SimpleQueue()

    def put(self, action: Action) -> None:
        """Let an action wait; any thread may."""
        self._asked.put(action)

    def run(self) -> list[str]:
        """Do what was asked for, in its order; return the sentences of what failed."""
        complaints: list[str] = []
        while not self._asked.empty():
            try:
                self._asked.get()()
            except HoppingLegError as error:
                complaints.append(str(error))
        return complaints

    def slider(
        self, label: str, bounds: Range, step: float, value: float, action: Action, hint: str = ""
    ) -> Any:  # noqa: ANN401
        """Add a slider."""
        low, high = bounds
        slider = self.gui.add_slider(
            label, min=low, max=high, step=step, initial_value=value, hint=hint or None
        )
        slider.on_update(self.asking(action))
        return slider

    def choice(self, label: str, offered: tuple[str, ...], value: str, action: Action) -> Any:  # noqa: ANN401
        """Add a list of what can be chosen."""
        choice = self.gui.add_dropdown(label, offered, initial_value=value)
        choice.on_update(self.asking(action))
        return choice

    def button(self, label: str, key: str, icon: Any, action: Action) -> Any:  # noqa: ANN401
        """Add a button that has a key, too."""
        self.key(label, key, action)
        button = self.gui.add_button(label, icon=icon, hint=f"Key {key}")
        button.on_click(self.asking(action))
        return button

    def key(self, label: str, key: str, action: Action) -> None:
        """Let a key do something."""
        self.gui.add_command(label, hotkey=key).on_trigger(self.asking(action))

    def asking(self, action: Action) -> Callable[[Any], Coroutine[Any, Any, None]]:
        """Return viser's callback for an action; what the server itself sets asks for nothing."""

        async def callback(event: viser.GuiEvent[Any] | viser.CommandEvent) -> None:
            if event.client is not None:
                self.put(action)

        return callback


NOBODY = "nobody"  # beside the leg
HEIGHT_STEP = 0.005  # of the slider, m
KEY_STEP = 0.01  # Of the keys K and J, m; arrows are the slider's own once it has the focus


_SETTINGS: dict[str, tuple[str, Range, float]] = {
    "payload": ("Payload, kg", live_leg.PAYLOAD, 0.05),
    "time_constant": ("Soft ground, s", live_leg.TIME_CONSTANT, 1e-3),
    "delay": ("Delay, s", live_leg.DELAY, 5e-4),
}
"""What each is called, what it can be, and the slider's step."""


class LivePanel:
    """Puts what the page asks for to a live simulation."""

    def __init__(self, inputs: Inputs, live: live_leg.LiveSimulation) -> None:
        self._live, gui = live, inputs.gui
        hint = "Commanded apex; keys K and J"
        self._height = inputs.slider(
            "Height, m", live.valid, HEIGHT_STEP, live.height,
            lambda: live.set_height(self._height.value), hint,
        )  # fmt: skip
        inputs.key("Higher", "K", lambda: self._change(KEY_STEP))
        inputs.key("Lower", "J", lambda: self._change(-KEY_STEP))
        names = self._names = tuple(dict.fromkeys((*controller_names(), *live.names)))
        legs = [name for name in shipped_robots() if load_robot(name).kind == "leg"]
        robots = self._robots = tuple(dict.fromkeys((*legs, live.robot_name)))
        self._first = inputs.choice("Controller", names, live.names[0], self._begin)
        beside = (*live.names, NOBODY)[1]
        self._second = inputs.choice("Beside it", (NOBODY, *names), beside, self._begin)
        self._robot = inputs.choice("Robot", robots, live.robot_name, self._begin)
        inputs.button("Stand up", "R", viser.Icon.RELOAD, live.stand)
        with gui.add_folder("Not told to the controller"):
            self._sliders = {
                name: inputs.slider(*shown, getattr(live.settings, name), self._settings)
                for name, shown in _SETTINGS.items()
            }
            hint = "The paper's noise and random delay of measurements"
            self._noise = gui.add_checkbox("Noise", live.settings.noise, hint=hint)
            self._noise.on_update(inputs.asking(self._settings))
        with gui.add_folder("Push the base"):
            force = inputs.slider("Force, N", live_leg.PUSH, 1.0, 30.0, lambda: None)
            up, down = viser.Icon.ARROW_UP, viser.Icon.ARROW_DOWN
            inputs.button("Push up", "P", up, lambda: live.push(force.value))
            inputs.button("Push down", "O", down, lambda: live.push(-force.value))

    def _change(self, by: float) -> None:
        self._height.value = self._live.set_height(self._live.height + by)

    def _begin(self) -> None:
        try:
            first, second = (chosen(h, (NOBODY, *self._names)) for h in (self._first, self._second))
            names = (first,) if second == NOBODY else (first, second)
            self._live.begin(names, chosen(self._robot, self._robots))
        finally:
            self._show()

    def _settings(self) -> None:
        values = {name: slider.value for name, slider in self._sliders.items()}
        self._live.set_settings(live_leg.LiveSettings(noise=self._noise.value, **values))

    def _show(self) -> None:
        """Bring all inputs in line with the simulation, which may have refused."""
        live = self._live
        self._height.min, self._height.max = live.valid
        self._height.value = live.height
        self._first.value, self._second.value = (*live.names, NOBODY)[:2]
        self._robot.value = live.robot_name
        self._noise.value = live.settings.noise
        for name, slider in self._sliders.items():
            slider.value = getattr(live.settings, name)


class ReplayPanel:
    """A slider for the time, which follows the replay as it plays."""

    def __init__(self, inputs: Inputs, replay: tracks.ReplaySource) -> None:
        self._replay, self._shown = replay, 0.0
        self._time = inputs.slider("Time, s", (0.0, replay.length), 0.01, 0.0, self._seek)

    def show(self) -> None:
        """Bring the slider in line with the replay, unless it was the slider that moved it."""
        if self._replay.now != self._shown:
            self._shown = self._replay.now
            self._time.value = round(self._shown, 2)

    def _seek(self) -> None:
        self._replay.seek(self._time.value)
        self._shown = self._replay.now


SPEEDS = (0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0)  # Shown seconds per second that can be chosen
LONGEST = 0.1  # Seconds that are made up for after a stall; more is left out


class PlaybackClock:
    """Turns time on the wall into time to be shown, in whole ticks of so many seconds."""

    def __init__(self, tick: float) -> None:
        self.speed, self.paused = 1.0, False
        self._tick = tick
        self._steps = 0
        self._owed = 0.0

    def step(self) -> None:
        """Pause, and show a tick more."""
        self.paused = True
        self._steps += 1

    def due(self, elapsed: float) -> float:
        """Return how much time to show, s, given the time on the wall since the last call, s."""
        ticks, self._steps = self._steps, 0
        self._owed = 0.0 if self.paused else self._owed + min(elapsed, LONGEST) * self.speed
        whole = int(self._owed / self._tick + 1e-9)
        self._owed = max(self._owed - whole * self._tick, 0.0)
        return (ticks + whole) * self._tick


def add_time_controls(inputs: Inputs, clock: PlaybackClock) -> None:
    """Let the page pause, step and choose the speed."""

    def pause() -> None:
        clock.paused = not clock.paused

    def set_speed() -> None:
        clock.speed = float(chosen(speed, names))

    inputs.button("Pause or go on", "space", viser.Icon.PLAYER_PAUSE, pause)
    inputs.button("Single step", "S", viser.Icon.PLAYER_SKIP_FORWARD, clock.step)
    names = tuple(f"{speed:g}" for speed in SPEEDS)
    speed = inputs.choice("Speed", names, "1", set_speed)
