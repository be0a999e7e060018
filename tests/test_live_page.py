"""The live page in a real browser: its physics and controllers against the package's."""

import base64
import importlib
import sys
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from hopping_leg.controllers.registry import load_controller
from hopping_leg.controllers.rollout import RolloutConfig, rollout
from hopping_leg.hop_detection import COLUMNS, find_hops
from hopping_leg.robot import TIMESTEP, load_robot, shipped_robots
from hopping_leg.sim import LegSimulator
from hopping_leg.sim.leg_table import LEG, leg_table
from hopping_leg.viewer.live_leg import LiveSettings
from tests.browser import serving
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


@pytest.fixture
def live_page(page, site):
    """The page, opened from a server of files."""
    with serving(site) as address:
        page.goto(f"{address}/live/index.html")
        yield page


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
@pytest.mark.parametrize("name", LEGS)
def test_changed_legs_and_their_ticks_in_air_and_contact_are_those_of_the_package(live_page, name):
    robot, rng = load_robot(name), np.random.default_rng(3)
    robot = LiveSettings(time_constant=0.03, payload=0.4, delay=0.01).apply(robot)
    q = rng.uniform([-0.5, -2.9], [1.4, 0.3], (300, 2))  # at the knee's stops, too
    standing = np.cos(q[:, 0]) * robot.thigh.length + np.cos(q.sum(1)) * robot.shank.length
    height = standing + robot.foot.radius + rng.choice([-0.03, -0.003, 0.001, 1.0], 300)
    states = np.column_stack([height, q, rng.normal(0, [0.8, 6, 9], (300, 3))])
    torques = rng.uniform([-12, -24], [12, 24], (300, 2))
    found = ask(
        live_page,
        "const [name, fields, dt, states, torques] = argument;"
        "const settings = { payload: 0.4, ground: 0.03, delay: 0.01 };"
        "const row = changedRow(shippedRobot(name), settings);"
        "const [latency] = ofRow(row, 'command_latency');"
        "const stepped = states.map((values, i) => {"
        "  const leg = new Stepper(0), [, q1, q2, , w1, w2] = values;"
        "  leg.row.set(row); leg.state.set(values); leg.rotor.set([q1, q2, w1, w2]);"
        "  leg.step(torques[i], latency, 0, 40, dt);"
        "  return [...leg.state];"
        "});"
        "return [stepped, Object.fromEntries(fields.map((name) => [name, [...ofRow(row, name)]]))]",
        [name, list(LEG.names), TIMESTEP, states.tolist(), torques.tolist()],
    )
    row = leg_table([robot], TIMESTEP)[0]
    for field in LEG.names:
        values = np.atleast_1d(row[field])
        np.testing.assert_allclose(found[1][field], values, 1e-12, 1e-15, err_msg=field)
    steady = replace(robot.reality.latency, measurement=0.0, jitter=0.0)
    robot = replace(robot, reality=replace(robot.reality, latency=steady))
    legs = LegSimulator(robot, 300, threads=1)
    legs.state[:] = states
    legs.forget(slice(None))
    legs.step(torques)
    np.testing.assert_allclose(found[0], legs.state, rtol=1e-12, atol=1e-12)


TICKS = 300  # Of a run, 1.5 s: three or four hops

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
const torques = [], took = [];
for (let tick = 0; tick < ticks; tick++) {
  const now = performance.now();
  torques.push([...leg.tick(command, 0)]);
  took.push(performance.now() - now);
}
return { torques, took, apexes: leg.apexes };
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
        ("rl", "legv2-identified", 3),
        ("universal", "legv1", 3),
        ("universal", "twin", 2),
        ("paper", "legv2-paper", 2),
        ("energy-shaping", "legv2-identified", 2),
        ("energy-shaping", "legv1", 2),
        ("fast", "twin", 1),
        ("energy-shaping", "twin", 2),
    ],
)
def test_first_hops_are_those_of_the_package_with_the_same_draws_and_keep_pace(
    live_page, controller, robot, hops
):
    seed, command, leg = 5, 0.3, load_robot(robot)
    expected = rollout(
        load_controller(controller, leg, simulated=True),
        RolloutConfig(leg, threads=1),
        np.full((TICKS, 1), command),
        seed,
    ).data
    column = {name: values[:, 0] for name, values in expected.items()}
    row = leg_table([leg], TIMESTEP)[0]
    draws = draws_of(seed, row["sensor_noise"].any(), row["command_jitter"].any())
    policy = resources.files("hopping_leg") / f"policies/{controller}.onnx"
    content = base64.b64encode(policy.read_bytes()).decode() if policy.is_file() else ""
    found = ask(live_page, RUN, [controller, robot, command, True, TICKS, *draws, content])
    torques = np.array(found["torques"]).T
    for name, values in zip(("hip", "knee"), torques, strict=True):
        np.testing.assert_allclose(values[:30], column[f"{name}_command_nm"][:30], atol=1e-4)
    apexes = find_hops(*(column[name] for name in COLUMNS)).apex
    assert len(apexes) >= hops
    np.testing.assert_allclose(found["apexes"][:hops], apexes[:hops], atol=1e-4)
    assert np.median(found["took"][100:]) < 1.0, "ms"


@pytest.mark.slow
def test_the_page_obeys(live_page):
    page = live_page
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
    page.get_by_label("Controller", exact=True).first.select_option("fast")
    page.get_by_label("Robot", exact=True).select_option("legv2")
    page.get_by_text("fast was trained on legv2-identified, not on legv2.").wait_for()
    for name, content, says in (
        ("mine.onnx", policy, "was trained on legv2-paper, not on legv2."),
        ("bad.onnx", policy[:999], "cannot be read as a policy."),
    ):
        file = {"name": name, "mimeType": "application/octet-stream", "buffer": content}
        page.locator("#file").set_input_files([file])
        page.get_by_text(f"{name} {says}").wait_for()
    for name in ("universal", "rl", "energy-shaping", "paper", "fast"):
        page.get_by_label("Controller", exact=True).select_option(name)
        page.locator("article .name").get_by_text(name, exact=True).first.wait_for()


@pytest.mark.slow
def test_one_file_holds_everything(page, site):
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    file = (site / "live/hopping-leg.html").as_uri()
    page.goto(file)
    page.wait_for_function("performance.getEntriesByName('first hop').length")
    page.get_by_label("Controller", exact=True).select_option("paper")
    page.get_by_text("paper was trained on legv2-paper, not on legv2-identified.").wait_for()
    assert {url for url in asked if not url.startswith("data:")} == {file}


def test_a_page_with_one_policy_is_small(live):
    pages = live.pages()
    loaded = [pages["live/index.html"], pages["live/policies/rl.onnx"]]
    loaded += [(DOCS / f"live/{name}.js").read_bytes() for name in live.MODULES]
    assert sum(map(len, loaded)) < 600e3
