"""The live page: a template, modules and what the package knows, put together at build time.

``live/index.html`` loads its modules and policies from beside it; ``live/hopping-leg.html`` is the
same page with everything inside, for a disk. Modules name each other ``live/NAME.js``; an import
map in the page says where those are.
"""

import base64
import dataclasses
import json
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import wasm

from hopping_leg.cli import DEMO
from hopping_leg.controllers import registry, robot_numbers
from hopping_leg.controllers.energy_shaping import EnergyShaping
from hopping_leg.controllers.observation_history import OBSERVATION_HISTORIES, AnyLeg, Dated
from hopping_leg.controllers.rollout import RolloutConfig
from hopping_leg.figures import controller_colours
from hopping_leg.hop_detection import FLIGHT_CLEARANCE
from hopping_leg.html_page import data_uri
from hopping_leg.robot import (
    DEFAULT_ROBOT,
    GRAVITY,
    TIMESTEP,
    Robot,
    SoftLimits,
    command_limits,
    load_robot,
    shipped_robots,
)
from hopping_leg.robot.parameters import PAPER_HEIGHT
from hopping_leg.sim import CONTROL_RATE, NoiseAndDelay
from hopping_leg.sim.channel import DELAY_DEPTH
from hopping_leg.sim.leg_table import LEG, leg_table
from hopping_leg.sim.stepper import COMMAND, MEMORY, SCRATCH
from hopping_leg.viewer import live_leg

FOLDER = Path(__file__).parent / "live"
MODULES = sorted(file.stem for file in FOLDER.glob("*.js"))
CONTROLLERS = (*DEMO, "rl", "fast", "paper")
"""In the order of the lists; the first two hop first."""

_PACKAGE = resources.files("hopping_leg")


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
    return {
        "rate": CONTROL_RATE,
        "timestep": TIMESTEP,
        "gravity": GRAVITY,
        "flight_clearance": FLIGHT_CLEARANCE,
        "delay_depth": DELAY_DEPTH,
        "stepper": {
            "code": base64.b64encode(wasm.stepper_module()).decode(),
            "row": _places(LEG),
            "memory": _places(MEMORY),
            "command": COMMAND,
            "rows": SCRATCH,
        },
        "noise": dataclasses.asdict(NoiseAndDelay()),
        "soft_limits": dataclasses.asdict(SoftLimits()),
        "ranges": {
            "payload": live_leg.PAYLOAD,
            "ground": live_leg.TIME_CONSTANT,
            "delay": live_leg.DELAY,
        },
        "push_seconds": live_leg.PUSH_SECONDS,
        "robot": DEFAULT_ROBOT,
        "robots": {name: of_robot(robot) for name, robot in legs.items()},
        "layouts": {
            name: {"lags": history.LAGS, "torque_lags": history.TORQUE_LAGS}
            for name, history in OBSERVATION_HISTORIES.items()
            if issubclass(history, Dated)
        },
        "any_leg": {
            "layout": AnyLeg.name,
            "late": AnyLeg.LATE,
            "middle": AnyLeg.MIDDLE,
            "command_gain": AnyLeg.COMMAND_GAIN,
            "foot_middle": AnyLeg.FOOT_MIDDLE.tolist(),
            "foot_gain": AnyLeg.FOOT_GAIN,
            "velocity_gain": AnyLeg.VELOCITY_GAIN,
            "straight_height": PAPER_HEIGHT,
        },
        "controllers": CONTROLLERS,
        "colours": controller_colours(CONTROLLERS),
        "other_colour": controller_colours([*CONTROLLERS, "a visitor's"])["a visitor's"],
        "policies": policies,
    }


def of_robot(robot: Robot) -> dict[str, Any]:
    """Return a robot's parameters and what the package computes of them."""
    shaping = registry.load_controller(registry.ENERGY_SHAPING, robot)
    assert isinstance(shaping, EnergyShaping)
    return _told(dataclasses.asdict(robot)) | {
        "row": np.frombuffer(leg_table([robot], TIMESTEP).tobytes()).tolist(),
        "start": RolloutConfig(robot).start_posture.tolist(),
        "heights": command_limits(robot),
        "gains": {name: float(value) for name, value in vars(shaping.gains).items()},
        "numbers": robot_numbers.robot_numbers(robot).tolist(),
        "full_torque": robot_numbers.full_torque(robot).tolist(),
        "fall_time": robot_numbers.fall_time(robot),
    }


def _told(tree: dict[str, Any]) -> dict[str, Any]:
    """Return a tree of parameters without what a file leaves out and what drives are called."""
    return {
        name: _told(value) if isinstance(value, dict) else value
        for name, value in tree.items()
        if value is not None and name not in ("hardware", "path", "description")
    }


def _places(kind: np.dtype[Any]) -> dict[str, tuple[int, int]]:
    """Return where the fields of a record of float64 begin, and how many numbers each holds."""
    fields = {name: (field[1], field[0].itemsize) for name, field in (kind.fields or {}).items()}
    return {name: (offset // 8, size // 8) for name, (offset, size) in fields.items()}


def _policies() -> list[str]:
    return [name for name in CONTROLLERS if name in registry.shipped_policies()]


def _json(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
