"""Inputs of the page, the queue that carries them to the thread that simulates, its clock."""

from collections.abc import Callable, Collection, Coroutine
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

import viser

from hopping_leg.controllers.registry import controller_names
from hopping_leg.errors import HoppingLegError, UsageError
from hopping_leg.io import is_number, one_line
from hopping_leg.robot import load_robot, shipped_robots
from hopping_leg.viewer import data_source, live_leg
from hopping_leg.viewer.live_leg import Range

Action = Callable[[], None]
_ROUNDING = 1e-6  # Of the page's numbers


def put_value(handle: Any, value: object) -> None:  # noqa: ANN401
    """Set an input of the page; viser's types take its values for read-only."""
    handle.value = value


def chosen(handle: Any, offered: Collection[str]) -> str:  # noqa: ANN401
    """Return a choice of the page; UsageError where it was not offered, e.g. a path."""
    if handle.value not in offered:
        raise UsageError(f"The page sent {one_line(handle.value)}, which it does not offer.")
    return str(handle.value)


def within(handle: Any, bounds: Range) -> float:  # noqa: ANN401
    """Return a number of the page; UsageError where its slider does not reach it."""
    value, (low, high) = handle.value, bounds
    if not is_number(value) or not low - _ROUNDING <= value <= high + _ROUNDING:
        raise UsageError(f"The page sent {one_line(value)}, not {low:g} to {high:g}.")
    return float(min(max(value, low), high))


class GuiQueue:
    """Actions in the order in which they came; callbacks of the page only put them in."""

    def __init__(self) -> None:
        self._actions: SimpleQueue[Action] = SimpleQueue()

    def put(self, action: Action) -> None:
        """Queue an action; any thread may."""
        self._actions.put(action)

    def run(self) -> list[str]:
        """Run all queued actions; return the sentences of those that failed."""
        complaints: list[str] = []
        while True:
            try:
                action = self._actions.get_nowait()
            except Empty:
                return complaints
            try:
                action()
            except HoppingLegError as error:
                complaints.append(str(error))

    def from_page(self, action: Action) -> Callable[[Any], Coroutine[Any, Any, None]]:
        """Return a callback for an input or key; what the server itself sets is no action."""

        async def callback(event: viser.GuiEvent[Any] | viser.CommandEvent) -> None:
            if event.client is not None:
                self.put(action)

        return callback

    def add_keys(self, gui: viser.GuiApi, *keys: tuple[str, Any, Action]) -> None:
        """Let keys of the page, each with what it is called, do something."""
        for label, key, action in keys:
            gui.add_command(label, hotkey=key).on_trigger(self.from_page(action))


NOBODY = "nobody"  # beside the leg
HEIGHT_STEP = 0.005  # of the slider, m
KEY_STEP = 0.01
"""Of the keys K and J, m; arrows are the slider's own once it has the focus."""


class _Setting(NamedTuple):
    label: str
    valid: Range
    scale: float  # shown over stored unit
    step: float  # as shown
    hint: str | None = None


_SETTINGS = {
    "payload": _Setting("Payload, kg", live_leg.PAYLOAD, 1.0, 0.05),
    "time_constant": _Setting(
        "Ground, ms", live_leg.TIME_CONSTANT, 1e3, 1.0, "Time constant; small is hard"
    ),
    "delay": _Setting("Delay, ms", live_leg.DELAY, 1e3, 0.5, "Of commands, beyond the robot's own"),
}


class LivePanel:
    """Puts what the page asks for to a live simulation."""

    def __init__(
        self, server: viser.ViserServer, queue: GuiQueue, live: live_leg.LiveSimulation
    ) -> None:
        self._live = live
        gui = server.gui
        hint = "Commanded apex; keys K and J"
        self._height = _slider(gui, "Height, m", live.valid, HEIGHT_STEP, live.height, hint)
        self._height.on_update(queue.from_page(self._set_height))
        names = self._names = tuple(dict.fromkeys((*controller_names(), *live.names)))
        self._first = gui.add_dropdown("Controller", names, initial_value=live.names[0])
        beside = live.names[1] if len(live.names) > 1 else NOBODY
        self._second = gui.add_dropdown("Beside it", (NOBODY, *names), initial_value=beside)
        legs = [name for name in shipped_robots() if load_robot(name).kind == "leg"]
        self._robots = tuple(dict.fromkeys((*legs, live.robot_name)))
        self._robot = gui.add_dropdown("Robot", self._robots, initial_value=live.robot_name)
        for dropdown in (self._first, self._second, self._robot):
            dropdown.on_update(queue.from_page(self._begin))
        stand = gui.add_button("Stand up", icon=viser.Icon.RELOAD, hint="Begin anew; key R")
        stand.on_click(queue.from_page(live.stand))
        with gui.add_folder("Not told to the controller"):
            self._sliders = {
                name: _slider(gui, s.label, _shown(s), s.step, self._setting(name), s.hint)
                for name, s in _SETTINGS.items()
            }
            hint = "The paper's noise and random delay of measurements"
            self._noise = gui.add_checkbox("Noise", live.settings.noise, hint=hint)
        self._noise.on_update(queue.from_page(self._settings))
        for slider in self._sliders.values():
            slider.on_update(queue.from_page(self._settings))
        with gui.add_folder("Push the base"):
            force = _slider(gui, "Force, N", live_leg.PUSH, 1.0, 30.0)
            up = gui.add_button("Push up", icon=viser.Icon.ARROW_UP, hint="Key P")
            down = gui.add_button("Push down", icon=viser.Icon.ARROW_DOWN, hint="Key O")

        def push(sign: int) -> None:
            live.push(sign * within(force, live_leg.PUSH))

        up.on_click(queue.from_page(lambda: push(1)))
        down.on_click(queue.from_page(lambda: push(-1)))
        queue.add_keys(
            gui,
            ("Higher", "K", lambda: self._change(KEY_STEP)),
            ("Lower", "J", lambda: self._change(-KEY_STEP)),
            ("Push up", "P", lambda: push(1)),
            ("Push down", "O", lambda: push(-1)),
            ("Stand up", "R", live.stand),
        )

    def _set_height(self) -> None:
        self._live.set_height(within(self._height, self._live.valid))

    def _change(self, by: float) -> None:
        put_value(self._height, self._live.set_height(self._live.height + by))

    def _begin(self) -> None:
        try:
            names: tuple[str, ...] = (chosen(self._first, self._names),)
            if self._second.value != NOBODY:
                names += (chosen(self._second, self._names),)
            self._live.begin(names, chosen(self._robot, self._robots))
        finally:
            self._show()

    def _settings(self) -> None:
        values = {
            name: within(self._sliders[name], _shown(setting)) / setting.scale
            for name, setting in _SETTINGS.items()
        }
        self._live.set_settings(live_leg.LiveSettings(noise=self._noise.value, **values))

    def _setting(self, name: str) -> float:
        """Return one as it is shown."""
        return _SETTINGS[name].scale * float(getattr(self._live.settings, name))

    def _show(self) -> None:
        """Bring all inputs in line with the simulation, which may have refused."""
        live = self._live
        self._height.min, self._height.max = live.valid
        put_value(self._height, live.height)
        put_value(self._first, live.names[0])
        put_value(self._second, live.names[1] if len(live.names) > 1 else NOBODY)
        put_value(self._robot, live.robot_name)
        put_value(self._noise, live.settings.noise)
        for name, slider in self._sliders.items():
            put_value(slider, self._setting(name))


def _shown(setting: _Setting) -> Range:
    low, high = setting.valid
    return setting.scale * low, setting.scale * high


def _slider(
    gui: viser.GuiApi,
    label: str,
    bounds: Range,
    step: float,
    value: float,
    hint: str | None = None,
) -> viser.GuiSliderHandle[float]:
    low, high = bounds
    return gui.add_slider(label, min=low, max=high, step=step, initial_value=value, hint=hint)


class ReplayPanel:
    """A slider for the time, which follows the replay as it plays."""

    def __init__(
        self, server: viser.ViserServer, queue: GuiQueue, replay: data_source.ReplaySource
    ) -> None:
        self._replay = replay
        self._time = server.gui.add_slider(
            "Time, s", min=0.0, max=replay.length, step=0.01, initial_value=0.0
        )
        self._time.on_update(queue.from_page(self._seek))
        self._shown = 0.0

    def show(self) -> None:
        """Bring the slider in line with the replay, unless it was the slider that moved it."""
        if self._replay.now != self._shown:
            self._shown = self._replay.now
            put_value(self._time, round(self._shown, 2))

    def _seek(self) -> None:
        self._replay.seek(within(self._time, (0.0, self._replay.length)))
        self._shown = self._replay.now


SPEEDS = (0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0)
"""Shown seconds per second that can be chosen."""

LONGEST = 0.1
"""Seconds that are made up for after a stall; more is left out."""


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
        if self.paused:
            self._owed = 0.0
        else:
            self._owed += min(elapsed, LONGEST) * self.speed
            whole = int(self._owed / self._tick + 1e-9)
            self._owed = max(self._owed - whole * self._tick, 0.0)
            ticks += whole
        return ticks * self._tick


class TimeControls:
    """Pause, step and speed, by buttons and keys."""

    def __init__(self, server: viser.ViserServer, queue: GuiQueue, clock: PlaybackClock) -> None:
        self._clock = clock
        gui = server.gui
        self._pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE, hint="Space")
        step = gui.add_button("Single step", icon=viser.Icon.PLAYER_SKIP_FORWARD, hint="Key S")
        names = tuple(f"{speed:g}" for speed in SPEEDS)
        speed = gui.add_dropdown("Speed", names, initial_value="1", hint="1 is real time")
        self._pause.on_click(queue.from_page(self._toggle))
        step.on_click(queue.from_page(self._step))

        def set_speed() -> None:
            clock.speed = float(chosen(speed, names))

        speed.on_update(queue.from_page(set_speed))
        queue.add_keys(
            gui, ("Pause or go on", "space", self._toggle), ("Single step", "S", self._step)
        )

    def _toggle(self) -> None:
        self._clock.paused = not self._clock.paused
        self._label()

    def _step(self) -> None:
        self._clock.step()
        self._label()

    def _label(self) -> None:
        paused = self._clock.paused
        self._pause.label = "Go on" if paused else "Pause"
        self._pause.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE
