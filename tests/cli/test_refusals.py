"""Bad input to any verb is one sentence and exit code 2, arms nothing and changes no file."""

import shlex
import shutil

import polars as pl
import pytest

from hopping_leg.controllers.registry import load_policy
from tests.cli.emulated import put_behind, write_sine
from tests.doc_pages import ROOT
from tests.identify.runs import SIDECAR, swinging, write_run

FAST = load_policy("fast").card
NEEDS = {"train": "torch", "reproduce": "torch", "view": "viser"}

REFUSED = [
    ("robot", "Did you mean 'robots'?"),
    ("robots show legv3", "There is no robot 'legv3'."),
    ("robots check examples/my_log.toml", "Or give a .toml file"),
    ("robots import leg.urdf", "leg.toml exists and is not replaced"),
    ("export policy empty.csv", "not a policy file"),
    ("export urdf --out /dev/full", "No space left on device"),
    ("evaluate leg.urdf", "make a robot file of it: hop robots import leg.urdf."),
    ("evaluate energy-shaping --robot leg.urdf", "`hop robots import` makes one of a URDF"),
    ('evaluate "my leg\'s.toml"', "is a robot file, no controller; give it with --robot"),
    ("evaluate spring --commands 0.5", "give heights from 0.29 to 0.31 m"),
    ("evaluate spring --commands high", "--commands"),
    ("evaluate spring --seed -1", "--seed is -1"),
    ("evaluate spring --threads -1", "'threads' is -1"),
    ("evaluate spring --timestep 0.003", "does not divide"),
    ("evaluate spring --json empty.csv/x.json", "x.json cannot be written"),
    ("deploy fasst", "Did you mean 'fast'"),
    ("deploy fast --command 0.6", f"from {FAST.command_low:.2f} to {FAST.command_high:.2f} m"),
    ("deploy fast --robot legv2", "; name its own with --robot. Train one"),
    ("deploy energy-shaping --schedule 0.3", "is no step of a schedule"),
    ("deploy energy-shaping --schedule 0.3:2 --command 0.3", "exclude each other"),
    ("deploy energy-shaping --seconds -1", "--seconds is -1"),
    ("deploy energy-shaping", "add --yes"),
    ("doctor --write", "name their --transport"),
    ("doctor --transport /none/port", "There is no serial port /none/port"),
    ("doctor --transport pi3hat", "pip install 'hopping-leg[pi3hat]'"),
    ("doctor --transport socketcn:can0", "python-can has no interface 'socketcn'"),
    ("emulate --seconds 0 --start-pose x", "There is no pose 'x'"),
    ("emulate --seconds 0 --faults none.toml", "Could not use none.toml"),
    ("record play", "No excitation was given"),
    ("record play sine.parquet --believed legv9", "There is no robot 'legv9'"),
    ("record play sine.parquet --damping -1 0", "must be zero or more"),
    ("record fixed-base --no-adapt", "cannot follow the trajectory"),
    ("identify", "No recording was named"),
    ("identify empty.csv", "empty.csv is no whole table"),
    ("identify short.csv", "short.csv is too short"),
    ("identify rest.csv", "is at rest"),
    ("identify good.csv other.csv", "belong to several robots (legv2, legv1)"),
    ("identify good.csv --validate good.csv", "use each for one of the two"),
    ("identify good.csv --robot legv1", "another leg's robot file"),
    ("identify good.csv --parameters hip.frction", "Did you mean 'hip.friction'"),
    ("identify good.csv --search cmaes", "Did you mean 'cma'"),
    ("identify good.csv --bounds hip.friction=low,high", "gives no bounds"),
    ("identify good.csv --generations 0", "CMA-ES needs a generation"),
    ("identify good.csv --json good.toml", "is an input"),
    ("identify good.csv --out good.toml", "is an input"),
    ("identify good.csv --out leg.json", "must end in .toml"),
    ("reproduce --seed -1", "--seed is -1"),
    ("train --sed 3", "--seed"),
    ("train --recipe slow", "There is no recipe 'slow'"),
    ("train --minutes -1", "must be positive"),
    ("train --steps 0", "must be 1 or more"),
    ("train --set learning_rat=1", "Did you mean 'learning_rate'"),
    ("train --set learning_rate=fast", "give e.g. learning_rate="),
    ("train --recipe paper --set reward.speed=3", "reward.height"),
    ("train --heights 0.4 0.2", "the smaller first"),
    ("train --observation dates", "dated, dated-long"),
    ("train --robot twin", "beyond transmissions and their losses"),
    ("train --out .", "holds no run"),
    ("view nobody", "There is no controller 'nobody'"),
    ("view fast paper fast", "give one, or two side by side"),
    ("view --trace none.blackbox", "Cannot read none.blackbox"),
    ("view --port 70000", "between 0 and 65535"),
    ('view "my leg\'s.toml"', "is a robot file, no controller; give it with --robot"),
]
MORE = {"deploy": " --transport /dev/leg", "view": " --seconds 0 --no-browser"}
"""Options of every command of a verb."""


def write_inputs(folder):
    """Write what the commands name: robots, an excitation, recordings with something wrong each."""
    shutil.copy(ROOT / "examples/my_leg.toml", folder / "my leg's.toml")
    shutil.copy(ROOT / "examples/leg.urdf", folder)
    (folder / "leg.toml").write_text("old")
    write_sine(folder, "rail", 300)
    (folder / "empty.csv").touch()
    write_run(folder, swinging(100), name="short.csv")
    rest = swinging().with_columns(hip_position_rad=pl.lit(0.3), knee_position_rad=pl.lit(-1.2))
    write_run(folder, rest.drop("hip_velocity_rad_s", "knee_velocity_rad_s"), name="rest.csv")
    sidecar = f'{SIDECAR}onboard = "zoh"\nstiffness = [8.0, 8.0]\ndamping = [0.3, 0.3]\n'
    write_run(folder, swinging(1600), sidecar, name="good.csv")
    write_run(folder, swinging(1600), sidecar.replace("legv2", "legv1"), name="other.csv")


@pytest.mark.parametrize(("command", "sentence"), REFUSED)
def test_bad_input_is_one_sentence_and_changes_nothing(
    command, sentence, tmp_path, monkeypatch, request, refused
):
    verb = command.split()[0]
    pytest.importorskip(NEEDS.get(verb, "hopping_leg"))
    monkeypatch.chdir(tmp_path)
    write_inputs(tmp_path)
    if "spring" in command:
        request.getfixturevalue("spring")
    held = put_behind(monkeypatch).robot if verb == "deploy" else None
    before = {path.name: path.is_file() and path.read_bytes() for path in tmp_path.iterdir()}
    refused(shlex.split(command + MORE.get(verb, "")), sentence)
    after = {path.name: path.is_file() and path.read_bytes() for path in tmp_path.iterdir()}
    assert after == before
    assert held is None or held.held
