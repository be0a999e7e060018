"""The live page in a real browser: its physics and controllers against the package's."""

import functools
import http.server
import importlib
import json
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.controllers.rollout import RolloutConfig, rollout
from hopping_leg.hop_detection import find_hops
from hopping_leg.io import replace_at
from hopping_leg.robot import TIMESTEP, load_robot, robot_text, shipped_robots
from hopping_leg.sim import LegSimulator
from hopping_leg.sim.leg_table import LEG, leg_table
from hopping_leg.sim.stepper import MEMORY
from hopping_leg.viewer.live_settings import LiveSettings
from tests.doc_pages import DOCS

LEGS = [name for name in shipped_robots() if load_robot(name).kind == "leg"]


@pytest.fixture(scope="module")
def live():
    """The module that builds the page."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS))
        yield importlib.import_module("macros_live")
    sys.modules.pop("macros_live", None)


@pytest.fixture(scope="module")
def site(live, tmp_path_factory):
    """The page's files in a folder."""
    folder = tmp_path_factory.mktemp("site")
    files = {f"live/{name}.js": (DOCS / f"live/{name}.js").read_bytes() for name in live.MODULES}
    for name, content in (files | live.pages()).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def address(site):
    """The page's address on a server of files."""
    handler = functools.partial(_Quiet, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/live/index.html"
        server.shutdown()


def ask(page, body, argument=None):
    """Evaluate the body of a function of (the page's modules, an argument)."""
    names = ["leg", "onnx", "plant", "policy", "robot", "shaping", "shooting", "stepper", "table"]
    imports = ", ".join(f'import("live/{name}.js")' for name in names)
    return page.evaluate(
        "async (argument) => { const modules = Object.assign({}, ..."
        f"(await Promise.all([{imports}]))); return (({{ {PUBLIC} }}) => {{ {body} }})(modules); }}",
        argument,
    )


PUBLIC = (
    "Leg, Plant, Policy, EnergyShaping, Shooting, changedRobot, legTable, makeMemory, readRobot,"
    " shippedRobot, stepLeg"
)
"""What the tests take from the page's modules."""


@pytest.mark.slow
def test_tables_are_those_of_the_package(page, address):
    page.goto(address)
    for name in LEGS:
        settings = LiveSettings(time_constant=0.03, payload=0.4, delay=0.01)
        robot = settings.apply(load_robot(name))
        row = leg_table([robot], TIMESTEP)[0]
        found = ask(
            page,
            "const settings = { payload: 0.4, ground: 0.03, delay: 0.01 };"
            "const robot = changedRobot(shippedRobot(argument[0]), settings);"
            "return legTable(robot, argument[1]);",
            [name, TIMESTEP],
        )
        for field in LEG.names:
            if field != "fixed_base":
                np.testing.assert_allclose(found[field], row[field], 1e-12, 1e-15, err_msg=field)


def ticks_of(robot, states, torques):
    """Return what the package makes of states, (n, 6), in a tick under torques, (n, 2)."""
    legs = LegSimulator(robot, len(states), threads=1)
    legs.state[:] = states
    legs.forget(slice(None))
    legs.step(torques)
    return legs.state


@pytest.mark.slow
@pytest.mark.parametrize("name", ["legv2-identified", "legv2-paper", "twin"])
def test_ticks_in_air_and_contact_are_those_of_the_package(page, address, name):
    page.goto(address)
    robot, rng = load_robot(name), np.random.default_rng(3)
    reality = robot.reality
    latency = replace(reality.latency, measurement=0.0, jitter=0.0)
    robot = replace(robot, reality=replace(reality, latency=latency))
    q = rng.uniform([-0.5, -2.9], [1.4, 0.3], (300, 2))  # at the knee's stops, too
    standing = np.cos(q[:, 0]) * robot.thigh.length + np.cos(q.sum(1)) * robot.shank.length
    height = standing + robot.foot.radius + rng.choice([-0.03, -0.003, 0.001, 1.0], 300)
    states = np.column_stack([height, q, rng.normal(0, [0.8, 6, 9], (300, 3))])
    torques = rng.uniform([-12, -24], [12, 24], (300, 2))
    found = ask(
        page,
        "const [name, dt, states, torques] = argument;"
        "const table = legTable(shippedRobot(name), dt);"
        "return states.map((values, i) => {"
        "  const state = Float64Array.from(values), memory = makeMemory();"
        "  memory.rotor.set([state[1], state[2], state[4], state[5]]);"
        "  memory.pending = [{ arrival: table.command_latency, torque: torques[i] }];"
        "  stepLeg(table, state, memory, [], 0, 40, dt);"
        "  return [...state];"
        "});",
        [name, TIMESTEP, states.tolist(), torques.tolist()],
    )
    expected = ticks_of(robot, states, torques)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
