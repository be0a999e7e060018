"""The live page in a real browser: its physics and controllers against the package's."""

import base64
import functools
import http.server
import importlib
import sys
import threading
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.controllers.rollout import RolloutConfig, rollout
from hopping_leg.hop_detection import find_hops
from hopping_leg.robot import TIMESTEP, load_robot, shipped_robots
from hopping_leg.sim import LegSimulator
from hopping_leg.sim.leg_table import LEG, leg_table
from hopping_leg.viewer.live_leg import LiveSettings
from tests.doc_pages import DOCS

LEGS = [name for name in shipped_robots() if load_robot(name).kind == "leg"]


@pytest.fixture(scope="module")
def live():
    """The module that builds the page."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS))
        yield importlib.import_module("live_page")
    sys.modules.pop("live_page", None)


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
    names = ["leg", "onnx", "plant", "policy", "robot", "shaping", "stepper"]
    imports = ", ".join(f'import("live/{name}.js")' for name in names)
    return page.evaluate(
        "async (argument) => { const modules = Object.assign({}, ..."
        f"(await Promise.all([{imports}])));"
        f" return (({{ {PUBLIC} }}) => {{ {body} }})(modules); }}",
        argument,
    )


PUBLIC = "Leg, Plant, Policy, EnergyShaping, Stepper, changedRow, ofRow, shippedRobot"
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
            "const row = changedRow(shippedRobot(argument[0]), settings);"
            "return Object.fromEntries(argument[1].map((name) => [name, [...ofRow(row, name)]]));",
            [name, list(LEG.names)],
        )
        for field in LEG.names:
            values = np.atleast_1d(row[field])
            np.testing.assert_allclose(found[field], values, 1e-12, 1e-15, err_msg=field)


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
        "const { row } = shippedRobot(name), [latency] = ofRow(Float64Array.from(row),"
        "  'command_latency');"
        "return states.map((values, i) => {"
        "  const leg = new Stepper(0), [, q1, q2, , w1, w2] = values;"
        "  leg.row.set(row); leg.state.set(values); leg.rotor.set([q1, q2, w1, w2]);"
        "  leg.step(torques[i], latency, 0, 40, dt);"
        "  return [...leg.state];"
        "});",
        [name, TIMESTEP, states.tolist(), torques.tolist()],
    )
    expected = ticks_of(robot, states, torques)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


TICKS = 300
"""Of a run, 1.5 s: three or four hops."""

RUN = """
const [name, robotName, command, noise, ticks, channel, sensors, jitter, bytes] = argument;
const robot = shippedRobot(robotName);
const controller = name === "energy-shaping" ? new EnergyShaping(name, robot)
  : new Policy(Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0)), name, robot);
const draws = { channel: () => channel.shift(), sensors: () => sensors.shift(),
  jitter: () => jitter.shift() };
const contact = robot.reality.ground?.time_constant ?? robot.contact.time_constant;
const settings = { payload: 0, ground: contact, delay: 0, noise };
const leg = new Leg(controller, robot, settings, command, draws);
const torques = [];
for (let tick = 0; tick < ticks; tick++) torques.push([...leg.tick(command, 0)]);
return { torques, apexes: leg.apexes };
"""


def draws_of(seed, noisy, jitters):
    """Return the numbers that a rollout of one leg draws: of its channel, sensors and commands."""
    rng = np.random.default_rng(seed)
    channel = rng.random((512, 8))
    (own,) = np.random.default_rng(seed).spawn(1)
    jitter, sensors = [], []
    for _ in range(TICKS):
        jitter += own.random(1).tolist() if jitters else []
        sensors += own.standard_normal((1, 6)).tolist() if noisy else []
    return channel.tolist(), sensors, jitter


@pytest.mark.slow
@pytest.mark.parametrize(
    ("controller", "robot", "hops"),
    [
        ("fast", "legv2-identified", 3),
        ("precise", "legv2-identified", 3),
        ("universal", "legv1", 3),
        ("universal", "twin", 2),
        ("paper", "legv2-paper", 2),
        ("energy-shaping", "legv2-identified", 2),
        ("energy-shaping", "legv1", 2),
        ("fast", "twin", 1),
        ("energy-shaping", "twin", 2),
    ],
)
def test_first_hops_are_those_of_the_package_with_the_same_draws(
    page, address, controller, robot, hops
):
    page.goto(address)
    seed, command, leg = 5, 0.3, load_robot(robot)
    expected = rollout(
        load_controller(controller, leg, other="accept", simulated=True),
        RolloutConfig(leg, threads=1),
        np.full((TICKS, 1), command),
        seed,
    ).data
    column = {name: values[:, 0] for name, values in expected.items()}
    row = leg_table([leg], TIMESTEP)[0]
    draws = draws_of(seed, row["sensor_noise"].any(), row["command_jitter"].any())
    policy = resources.files("hopping_leg") / f"policies/{controller}.onnx"
    content = base64.b64encode(policy.read_bytes()).decode() if policy.is_file() else ""
    found = ask(page, RUN, [controller, robot, command, True, TICKS, *draws, content])
    torques = np.array(found["torques"]).T
    for name, values in zip(("hip", "knee"), torques, strict=True):
        np.testing.assert_allclose(values[:30], column[f"{name}_command_nm"][:30], atol=1e-4)
    names = ("height_m", "height_rate_m_s", "foot_clearance_m")
    apexes = find_hops(*(column[name] for name in names)).apex
    assert len(apexes) >= hops
    np.testing.assert_allclose(found["apexes"][:hops], apexes[:hops], atol=1e-4)


@pytest.mark.slow
def test_the_page_obeys_and_keeps_pace(page, address, tmp_path):
    page.goto(address)
    page.wait_for_function("performance.getEntriesByName('first hop').length")
    assert page.evaluate("document.documentElement.scrollWidth") == page.viewport_size["width"]
    page.get_by_label("Height", exact=True).fill("0.35")
    page.wait_for_function(
        "[...document.querySelectorAll('article dd:nth-of-type(1)')]"
        ".every((cell) => Math.abs(parseFloat(cell.textContent) - 0.35) < 0.015)"
    )
    page.locator("h1").click()
    page.keyboard.press("k")
    assert page.locator("#height-value").inner_text() in ("0.355 m", "0.360 m")
    policy = (resources.files("hopping_leg") / "policies/paper.onnx").read_bytes()
    page.get_by_label("Robot", exact=True).select_option("legv2")
    page.get_by_text("fast was trained on legv2-identified, not on legv2.").wait_for()
    page.locator("#file").set_input_files(
        [{"name": "mine.onnx", "mimeType": "application/octet-stream", "buffer": policy}]
    )
    page.get_by_text("mine.onnx was trained on legv2-paper, not on legv2.").wait_for()
    page.locator("#file").set_input_files(
        [{"name": "bad.onnx", "mimeType": "application/octet-stream", "buffer": policy[:999]}]
    )
    page.get_by_text("bad.onnx cannot be read as a policy.").wait_for()
    for name in ("universal", "precise", "energy-shaping", "paper", "fast"):
        page.get_by_label("Controller", exact=True).select_option(name)
        page.locator("article .name").get_by_text(name, exact=True).first.wait_for()
    took = ask(
        page,
        "return Promise.all([fetch('policies/universal.onnx').then((a) => a.arrayBuffer())]).then("
        "([bytes]) => { const robot = shippedRobot('legv2-identified');"
        "const settings = { payload: 0, ground: 0.02, delay: 0, noise: true };"
        "const policy = new Policy(new Uint8Array(bytes), 'universal', robot);"
        "const leg = new Leg(policy, robot, settings, 0.3); const took = [];"
        "for (let i = 0; i < 600; i++) { const now = performance.now(); leg.tick(0.3, 0);"
        "took.push(performance.now() - now); } return took; });",
    )
    assert np.median(took[100:]) < 1.0


@pytest.mark.slow
def test_one_file_holds_everything(browser, site):
    page, asked, complaints = browser.new_page(), [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    file = (site / "live/hopping-leg.html").as_uri()
    page.goto(file)
    page.wait_for_function("performance.getEntriesByName('first hop').length")
    page.get_by_label("Controller", exact=True).select_option("paper")
    page.get_by_text("paper was trained on legv2-paper, not on legv2-identified.").wait_for()
    page.close()
    assert complaints == []
    assert {url for url in asked if not url.startswith("data:")} == {file}


def test_a_page_with_one_policy_is_small(live):
    files = {f"{name}.js": (DOCS / f"live/{name}.js").read_bytes() for name in live.MODULES}
    pages = live.pages()
    loaded = [*files.values(), pages["live/index.html"], pages["live/policies/precise.onnx"]]
    assert sum(map(len, loaded)) < 600e3
