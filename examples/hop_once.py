"""Run a controller on eight simulated legs with the paper's noise and delay; print the apexes."""

from pathlib import Path

import numpy as np

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller
from hopping_leg.hop_detection import find_hops
from hopping_leg.robot import load_robot

robot = load_robot("legv2-paper")
controller = load_controller("energy-shaping", robot)
commands = np.full((2000, 8), 0.30)  # m; 10 s at 200 Hz, eight legs
run = rollout(controller, RolloutConfig(robot), commands, seed=0)

height, rate = run.data["height_m"], run.data["height_rate_m_s"]
clearance = run.data["foot_clearance_m"]
for leg in range(8):
    hops = find_hops(height[:, leg], rate[:, leg], clearance[:, leg])
    print(f"leg {leg}: {len(hops.apex)} hops, median apex {np.median(hops.apex):.3f} m")
run.trace(0).save(Path("runs/hop_once.parquet"))
