"""Identify a leg from a CSV file and a sidecar that says how it was recorded.

Run it as ``python examples/identify_from_csv.py [RUN.csv]``, with RUN.toml beside your file.
Without one, the shipped twin plays a lab's leg and leaves both files in runs/. What is found is
runs/lab-leg.toml.
"""

import sys
from pathlib import Path

from hopping_leg.identify.excitation import Multisine, make_excitation
from hopping_leg.identify.pipeline import identify
from hopping_leg.identify.play_excitation import play
from hopping_leg.identify.recording import load_recording
from hopping_leg.identify.result import parameters_json, save_robot
from hopping_leg.robot import load_robot

SIDECAR = """\
rig = "fixed-base"
rate_hz = 200.0
robot = "legv2"            # what is believed of the leg so far
source = "our lab, first run"
onboard = "zoh"            # a PD with these gains, computed once per row
stiffness = [20.0, 12.0]   # hip and knee, N m/rad
damping = [0.3, 0.15]      # N m s/rad

[columns]                  # what the lab calls them
time_s = "t"
hip_position_rad = "q1"
knee_position_rad = "q2"
hip_torque_nm = "tau1"
knee_torque_nm = "tau2"
hip_position_command_rad = "q1_des"
knee_position_command_rad = "q2_des"
"""


def record(file: Path) -> None:
    """Let the twin swing in the air for 10 s and write what a lab would have of it."""
    names = [line.split(" = ") for line in SIDECAR.split("lab calls them\n")[1].splitlines()]
    swing = Multisine((0.7, -1.4), (0.3, 0.4), duration=10.0)
    run = play(make_excitation(swing, load_robot("legv2")), load_robot("twin"), believed="legv2")
    table = run.trace.table.select(ours for ours, _ in names)
    table.columns = [theirs.strip('"') for _, theirs in names]
    file.parent.mkdir(exist_ok=True)
    table.write_csv(file, float_precision=6)
    file.with_suffix(".toml").write_text(SIDECAR)


file = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/lab.csv")
if len(sys.argv) == 1:
    record(file)
recording = load_recording(file)
found = identify([recording], load_robot(recording.metadata.robot))
for row in parameters_json(found):
    print("{name}: {value:.4g} in [{interval_low:.4g}, {interval_high:.4g}] {unit}".format(**row))
save_robot(found, Path("runs/lab-leg.toml"), recording.metadata.robot)
