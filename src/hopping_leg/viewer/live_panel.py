"""Inputs of a live simulation: height, controllers, robot, world, push."""

import dataclasses

import viser

from hopping_leg.controllers.registry import controller_names
from hopping_leg.robot import load_robot
from hopping_leg.robot.robot_files import shipped_robots
from hopping_leg.viewer import world as ranges
from hopping_leg.viewer.inbox import Inbox, put_value
from hopping_leg.viewer.live import Live

NOBODY = "nobody"
"""Beside the leg."""

HEIGHT_STEP = 0.005
"""Of the slider, m."""

KEY_STEP = 0.01
"""Of the keys K and J, m; arrows are the slider's own once it has the focus."""


class LivePanel:
    """Puts what the page asks for to a live simulation.

    Args:
        server: Of the page.
        inbox: For what is asked.
        live: The simulation.
        robot: Name or file that it was started with.
    """

    def __init__(self, server: viser.ViserServer, inbox: Inbox, live: Live, robot: str) -> None:
        self._live = live
        gui = server.gui
        low, high = live.valid
        self._height = gui.add_slider(
            "Height, m",
            min=low,
            max=high,
            step=HEIGHT_STEP,
            initial_value=live.height,
            hint="Commanded apex; keys K and J",
        )
        self._height.on_update(inbox.from_page(lambda: self._aim(self._height.value)))
        names = (*controller_names(), *(n for n in live.names if n not in controller_names()))
        self._first = gui.add_dropdown("Controller", names, initial_value=live.names[0])
        beside = live.names[1] if len(live.names) > 1 else NOBODY
        self._second = gui.add_dropdown("Beside it", (NOBODY, *names), initial_value=beside)
        for dropdown in (self._first, self._second):
            dropdown.on_update(inbox.from_page(self._controllers))
        legs = [name for name in shipped_robots() if load_robot(name).kind == "leg"]
        robots = tuple(legs if robot in legs else [*legs, robot])
        self._robot = gui.add_dropdown("Robot", robots, initial_value=robot)
        self._robot.on_update(inbox.from_page(self._take_robot))
        stand = gui.add_button("Stand up", icon=viser.Icon.RELOAD, hint="Begin anew; key R")
        stand.on_click(inbox.from_page(live.stand))
        with gui.add_folder("World, unknown to the controller"):
            self._add_world(gui, inbox)
        with gui.add_folder("Push the base"):
            force = _slider(gui, "Force, N", ranges.PUSH, 1.0, 30.0)
            up = gui.add_button("Push up", icon=viser.Icon.ARROW_UP, hint="Key P")
            down = gui.add_button("Push down", icon=viser.Icon.ARROW_DOWN, hint="Key O")
        up.on_click(inbox.from_page(lambda: live.push(force.value)))
        down.on_click(inbox.from_page(lambda: live.push(-force.value)))
        keys = (
            ("Higher", "K", lambda: self._change(KEY_STEP)),
            ("Lower", "J", lambda: self._change(-KEY_STEP)),
            ("Push up", "P", lambda: live.push(force.value)),
            ("Push down", "O", lambda: live.push(-force.value)),
            ("Stand up", "R", live.stand),
        )
        for label, key, wish in keys:
            gui.add_command(label, hotkey=key).on_trigger(inbox.from_keys(wish))  # type: ignore[arg-type]

    def _add_world(self, gui: viser.GuiApi, inbox: Inbox) -> None:
        world = self._live.world
        self._payload = _slider(gui, "Payload, kg", ranges.PAYLOAD, 0.05, world.payload)
        self._ground = _slider(
            gui,
            "Ground, ms",
            _thousandfold(ranges.TIME_CONSTANT),
            1.0,
            1e3 * world.time_constant,
            "Time constant; small is hard",
        )
        self._delay = _slider(
            gui,
            "Delay, ms",
            _thousandfold(ranges.DELAY),
            0.5,
            1e3 * world.delay,
            "Of commands, beyond the robot's own",
        )
        self._noise = gui.add_checkbox(
            "Noise", world.noise, hint="The paper's noise and random delay of measurements"
        )
        for handle in (self._payload, self._ground, self._delay, self._noise):
            handle.on_update(inbox.from_page(self._world))

    def _aim(self, height: float) -> None:
        self._live.aim(height)

    def _change(self, by: float) -> None:
        put_value(self._height, self._live.aim(self._live.height + by))

    def _controllers(self) -> None:
        beside = self._second.value
        names = (self._first.value,) if beside == NOBODY else (self._first.value, beside)
        try:
            self._live.take_controllers(names)
        finally:
            self._show()

    def _take_robot(self) -> None:
        try:
            self._live.take_robot(self._robot.value)
        finally:
            self._show()

    def _world(self) -> None:
        self._live.change_world(
            dataclasses.replace(
                self._live.world,
                payload=self._payload.value,
                time_constant=1e-3 * self._ground.value,
                delay=1e-3 * self._delay.value,
                noise=self._noise.value,
            )
        )

    def _show(self) -> None:
        """Bring all inputs in line with the simulation, which may have refused."""
        live = self._live
        self._height.min, self._height.max = live.valid
        put_value(self._height, live.height)
        put_value(self._first, live.names[0])
        put_value(self._second, live.names[1] if len(live.names) > 1 else NOBODY)
        put_value(self._payload, live.world.payload)
        put_value(self._noise, live.world.noise)
        put_value(self._ground, 1e3 * live.world.time_constant)
        put_value(self._delay, 1e3 * live.world.delay)


def _slider(
    gui: viser.GuiApi,
    label: str,
    bounds: ranges.Range,
    step: float,
    value: float,
    hint: str | None = None,
) -> viser.GuiSliderHandle[float]:
    low, high = bounds
    return gui.add_slider(label, min=low, max=high, step=step, initial_value=value, hint=hint)


def _thousandfold(bounds: ranges.Range) -> ranges.Range:
    return 1e3 * bounds[0], 1e3 * bounds[1]
