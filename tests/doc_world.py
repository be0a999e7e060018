"""What stands around the commands of the documentation: what makes them short, and their files."""

import shutil
from pathlib import Path

import numpy as np
import polars.selectors as cs

from hopping_leg import cli
from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller
from hopping_leg.deploy.flight_recorder import FlightRecorder
from hopping_leg.robot import load_robot
from hopping_leg.sim.randomization import draw_twin
from hopping_leg.trace import Trace
from tests.doc_pages import ROOT, blocks

SHORTER = {
    "hop demo": "--no-browser --port 0 --seconds 0.5",
    "hop deploy": "--seconds 0.3 --yes",
    "hop doctor --home": "--yes",
    "hop doctor --write": "--yes",
    "hop emulate": "--seconds 0.3 --no-realtime",
    "hop evaluate": "--seeds 1 --commands 0.3 --floor soft",
    "hop record fixed-base": "--amplitudes 0.05 --periods 0.5 --swings 10 --duration 10",
    "hop record moving-base": "--amplitudes 0.05 --periods 0.5 --duration 10",
    "hop record multisine": "--duration 10",
    "hop identify": "--parameters hip.friction,knee.friction",
    "hop record play --transport": "--yes",
    "hop train": "--steps 1 --heights 0.28 0.32",
    "hop train --recipe universal": "--steps 1 --heights .3 .32 --set num_envs=64 batch_size=1024",
    "hop view": "--no-browser --port 0 --seconds 0.5",
}
"""Options added to every command with these words; of several entries the one with the most words
counts."""

SECONDS = {
    "hopping_leg.evaluate.trials.FIXED_SECONDS": 3.0,
    "hopping_leg.evaluate.trials.STEP_SECONDS": 2.0,
}
"""Lengths of the paper's trials, which have no option."""

ELSEWHERE = ("hop evaluate runs/my_leg/gains.toml", "hop reproduce")
"""Commands that would take minutes and have tests elsewhere; here only their options must parse."""

CODES = {
    "hop train --recipe paper --seed 0 --out runs/mine": cli.INTERRUPTED,
    "hop doctor --transport /dev/fdcanusb --robot my_leg.toml --home 0.0 0.0": cli.FAILED,
}
"""Exit codes other than 0: a training that is interrupted, a straight leg that is not armed."""

AFTER = {
    "environment": "assert model.num_timesteps == 2048",
    "identify": """import json; from pathlib import Path
row = json.loads(Path("identified.json").read_text())["quality"][0]
assert all(row[f"{joint}_after"] < row[f"{joint}_before"] for joint in ("hip", "knee"))""",
    "robot": """import json; from pathlib import Path
rows = json.loads(Path("runs/heron/first/evaluation.json").read_text())["summary"]
assert all(row["hops"] for row in rows)""",
}
"""Python that holds at the end of a page."""

BEFORE = {"own-controller": "class TheirController:\n    def __init__(self, mass, dt): pass"}
"""Python that a page takes for granted."""

KILLED = "runs/deploy/fast-20260501-101500.blackbox"


def shorten(words: list[str]) -> list[str]:
    """Return a command with the options that make it short; of an option the last one counts."""
    fitting = [key for key in SHORTER if set(key.split()) <= set(words)]
    added = SHORTER[max(fitting, key=lambda key: len(key.split()))] if fitting else ""
    return [*words, *added.split()]


def furnish(page: str) -> None:
    """Put what a page takes for granted, or lets the reader write, into the current folder."""
    code = "\n\n".join(b.text for b in blocks(page) if b.language in ("bash", "python"))
    if "examples/" in code:
        shutil.copytree(ROOT / "examples", "examples")
    if "my_leg.toml" in code:
        legs = [b.text for b in blocks(page) if b.text.startswith('name = "my-leg"')]
        text = legs[0] if legs else (ROOT / "examples/my_leg.toml").read_text()
        Path("my_leg.toml").write_text(text)
    Path("runs/deploy").mkdir(parents=True)
    make = {
        "deploy": (_wired_leg, _killed_run),
        "evaluation": (_trained_policy,),
        "other-tools": (_bag, _stored_trial, _trained_policy),
        "own-controller": (write_tutorial,),
        "transfer": (lambda: draw_twin(0).save(Path("my_twin.toml")),),
        "viewer": (_stored_trial, _killed_run),
    }
    for part in make.get(page, ()):
        part()


def write_tutorial() -> None:
    """Write the file that the page on own controllers lets the reader write."""
    code = [b.text for b in blocks("own-controller") if b.language == "python"][:3]
    Path("first.py").write_text("\n\n".join(code))


def _trained_policy() -> None:
    Path("runs/mine").mkdir()
    shutil.copy(ROOT / "src/hopping_leg/policies/fast.onnx", "runs/mine/policy.onnx")


def _bag() -> None:
    """Leave a recording that others made."""
    from hopping_leg.formats import to_mcap
    from hopping_leg.identify.excitation import Multisine, make_excitation
    from hopping_leg.identify.play_excitation import play

    leg = load_robot("legv2")
    made = play(make_excitation(Multisine(duration=12.0), leg), leg, believed="legv2").trace
    Path("bag.mcap").write_bytes(to_mcap(made))
    Path("bag.toml").write_text(
        'rig = "fixed-base"\nrate_hz = 200.0\nrobot = "legv2"\nsource = "made up"\n'
        'onboard = "zoh"\nstiffness = [20.0, 12.0]\ndamping = [0.3, 0.15]\n'
    )


def _wired_leg() -> None:
    """Write the page's table into the robot file, for drives whose serial number nobody knows."""
    friction = 'friction = { value = 0.3, unit = "N m", source = "made up" }'
    Path("real_leg.toml").write_text(
        f'name = "real-leg"\nextends = "my_leg.toml"\n[hip]\n{friction}\n[knee]\n{friction}\n'
    )
    (table,) = [b.text for b in blocks("deploy") if b.text.startswith("[hardware]")]
    table = "".join(line for line in table.splitlines(True) if not line.startswith("serial"))
    with Path("my_leg.toml").open("a") as file:
        file.write(f"\n{table}")


def _trial() -> Trace:
    leg, commands = load_robot("legv2-paper"), np.full((600, 1), 0.3)
    controller = load_controller("energy-shaping", leg)
    return rollout(controller, RolloutConfig(leg), commands, seed=0).trace(0)


def _stored_trial() -> None:
    _trial().save(Path("run.parquet"))


def _killed_run() -> None:
    """Leave what `hop deploy` leaves when it is killed."""
    trace = _trial()
    table = trace.table.select(cs.exclude("height_m", "height_rate_m_s", cs.contains("clearance")))
    box = FlightRecorder(Path(KILLED), tuple(table.columns), trace.header)
    for row in table.iter_rows():
        box.row(row)
    box.close()
