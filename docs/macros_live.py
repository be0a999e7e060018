"""The live page: a template, modules and what the package knows, put together at build time.

``live/index.html`` loads its modules and policies from beside it; ``live/hopping-leg.html`` is the
same page with everything inside, for a disk. Modules name each other ``live/NAME.js``; an import
map in the page says where those are.
"""

import dataclasses
import json
from importlib import resources
from pathlib import Path
from typing import Any, get_type_hints

import jinja2

from hopping_leg.colours import controller_colours
from hopping_leg.controllers import registry, robot_numbers
from hopping_leg.controllers.energy_shaping.gains import (
    FORCES,
    POWERS_OF_SIZE,
    load_gains,
    own_gains,
)
from hopping_leg.controllers.mpc import HopShape
from hopping_leg.controllers.observation_history import OBSERVATION_HISTORIES, AnyLeg, Dated
from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.html_page import data_uri
from hopping_leg.robot import (
    DEFAULT_ROBOT,
    GRAVITY,
    TIMESTEP,
    Robot,
    SoftLimits,
    load_robot,
    shipped_robots,
)
from hopping_leg.robot.model import (
    FRICTION_IMPEDANCE,
    FRICTION_TIME_CONSTANT,
    STOP_IMPEDANCE,
    STOP_TIME_CONSTANT,
)
from hopping_leg.robot.parameters import DEFAULT_STOPS, PAPER_HEIGHT
from hopping_leg.sim import CONTROL_RATE, NoiseAndDelay
from hopping_leg.sim.channel import DELAY_DEPTH
from hopping_leg.viewer import live_settings
from hopping_leg.viewer.live_leg import PUSH_SECONDS

FOLDER = Path(__file__).parent / "live"
MODULES = sorted(file.stem for file in FOLDER.glob("*.js"))
CONTROLLERS = (
    "fast", registry.ENERGY_SHAPING, "universal", registry.MPC_TRUE_STATE, "precise", "paper",
)  # fmt: skip
"""In the order of the lists; the first two hop first."""

_PACKAGE = resources.files("hopping_leg")
_COMPUTED = ("armature", "stop_lower", "stop_upper")
"""What the package computes where a file leaves it out, and so does the page."""


def pages() -> dict[str, bytes]:
    """Return the files of the live page by their addresses on the site."""
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False)
    template = environment.from_string((FOLDER / "page.html.j2").read_text(encoding="utf-8"))
    policies = {name: (_PACKAGE / f"policies/{name}.onnx").read_bytes() for name in _policies()}
    inside = {name: data_uri(one, "application/octet-stream") for name, one in policies.items()}
    beside = {name: f"policies/{name}.onnx" for name in policies}
    code = {name: (FOLDER / f"{name}.js").read_bytes() for name in MODULES}
    imports = {f"live/{name}.js": data_uri(code[name], "text/javascript") for name in MODULES}
    numbers = {"rate": round(CONTROL_RATE), "steps": round(1 / TIMESTEP), "first": CONTROLLERS[0]}
    whole = template.render(
        numbers, imports=imports, modules=[], data=_json(data(inside)), offline=True
    )
    split = template.render(
        numbers, imports={"live/": "./"}, modules=MODULES, data=_json(data(beside)), offline=False
    )
    files = {f"live/policies/{name}.onnx": content for name, content in policies.items()}
    pages = {"live/index.html": split, "live/hopping-leg.html": whole}
    return files | {name: text.encode() for name, text in pages.items()}


def data(policies: dict[str, str]) -> dict[str, Any]:
    """Return what the page's modules know of the package; policies by their addresses."""
    robots = {name: load_robot(name) for name in shipped_robots()}
    legs = {name: robot for name, robot in robots.items() if robot.kind == "leg"}
    usual = robots[DEFAULT_ROBOT]
    stretched = usual.thigh.length + usual.shank.length
    return {
        "rate": CONTROL_RATE,
        "timestep": TIMESTEP,
        "gravity": GRAVITY,
        "start_share": RolloutConfig(usual).standing_length / stretched,
        "flight_clearance": FLIGHT_CLEARANCE,
        "delay_depth": DELAY_DEPTH,
        "stop": {
            "time_constant": STOP_TIME_CONSTANT,
            "impedance": STOP_IMPEDANCE[1],
            "reach": DEFAULT_STOPS,
        },
        "dry_friction": {
            "time_constant": FRICTION_TIME_CONSTANT,
            "impedance": FRICTION_IMPEDANCE[0],
        },
        "noise": dataclasses.asdict(NoiseAndDelay()),
        "soft_limits": dataclasses.asdict(SoftLimits()),
        "ranges": {
            "payload": live_settings.PAYLOAD,
            "ground": live_settings.TIME_CONSTANT,
            "delay": live_settings.DELAY,
        },
        "push_seconds": PUSH_SECONDS,
        "robot": DEFAULT_ROBOT,
        "robots": {name: numbers(robot) for name, robot in legs.items()},
        "fields": dict(fields(Robot)),
        "layouts": {
            name: {"lags": history.LAGS, "torque_lags": history.TORQUE_LAGS}
            for name, history in OBSERVATION_HISTORIES.items()
            if issubclass(history, Dated)
        },
        "shaping": {
            "gains": _gains(),
            "powers_of_size": POWERS_OF_SIZE,
            "forces": FORCES,
        },
        "any_leg": {
            "layout": AnyLeg.name,
            "late": AnyLeg.LATE,
            "middle": AnyLeg.MIDDLE,
            "command_gain": AnyLeg.COMMAND_GAIN,
            "foot_middle": AnyLeg.FOOT_MIDDLE.tolist(),
            "foot_gain": AnyLeg.FOOT_GAIN,
            "velocity_gain": AnyLeg.VELOCITY_GAIN,
            "full_torque": robot_numbers.FULL_TORQUE.tolist(),
            "scales": robot_numbers.MIDDLES_AND_SPREADS.tolist(),
            "least": robot_numbers.LEAST,
            "most": robot_numbers.MOST,
            "usual": robot_numbers.USUAL,
            "straight_height": PAPER_HEIGHT,
        },
        "shape": dataclasses.asdict(HopShape()),
        "controllers": CONTROLLERS,
        "colours": controller_colours(CONTROLLERS),
        "other_colour": controller_colours([*CONTROLLERS, "a visitor's"])["a visitor's"],
        "policies": policies,
    }


def numbers(robot: Robot) -> dict[str, float]:
    """Return every number of a robot that the physics depends on, by its path in a robot file."""
    return dict(_flat(dataclasses.asdict(robot), ""))


def _flat(tree: dict[str, Any], prefix: str) -> Any:  # noqa: ANN401
    for key, value in tree.items():
        if isinstance(value, dict) and prefix + key != "hardware":
            yield from _flat(value, f"{prefix}{key}.")
        elif isinstance(value, float):
            yield prefix + key, value


def fields(kind: type, prefix: str = "") -> Any:  # noqa: ANN401
    """Yield the numbers that a robot file may hold: paths, units, what is valid, defaults."""
    hints = get_type_hints(kind)
    for field in dataclasses.fields(kind):
        path, unit = prefix + field.name, field.metadata.get("unit")
        if unit is not None:
            entry: dict[str, Any] = dict(field.metadata)
            if field.default is not dataclasses.MISSING:
                known = field.default is not None and field.name not in _COMPUTED
                entry["default"] = field.default if known else None
            yield path, entry
        elif dataclasses.is_dataclass(hints[field.name]) and path != "hardware":
            yield from fields(hints[field.name], f"{path}.")


def _gains() -> dict[str, Any]:
    """Return the tuned sets of gains: the one for all legs, and those of some leg alone."""
    robots = [load_robot(name) for name in shipped_robots()]
    names = {own_gains(registry.ENERGY_SHAPING, robot) for robot in robots}
    found = {name: load_gains(name) for name in sorted(names | {registry.ENERGY_SHAPING})}
    return {
        name: {"robot": one.robot, "gains": dataclasses.asdict(one.gains)}
        for name, one in found.items()
    }


def _policies() -> list[str]:
    return [name for name in CONTROLLERS if name in registry.shipped_policies()]


def _json(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
