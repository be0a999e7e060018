"""Plot the height while the leg hops; without a screen, write the last picture to a file."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import get_backend

from hopping_leg.controllers import RolloutConfig, rollout
from hopping_leg.controllers.registry import load_controller
from hopping_leg.robot import load_robot

SHOWN_EVERY = 20
"""Ticks between two pictures: ten a second at 200 Hz."""

leg = load_robot("legv2-paper")
command = np.repeat([0.25, 0.30, 0.35], 600)  # m; 3 s each
run = rollout(load_controller("energy-shaping", leg), RolloutConfig(leg), command[:, None], seed=0)
time, height = run.time, run.data["height_m"][:, 0]

figure, axes = plt.subplots(layout="constrained")
axes.set(xlabel="time / s", ylabel="base height / m", xlim=(0, time[-1]), ylim=(0.1, 0.4))
axes.step(time, command, where="post", color="0.5", label="command")
(line,) = axes.plot([], [], label="base height")
axes.legend(loc="upper left")

screen = get_backend().lower() != "agg"
for tick in range(SHOWN_EVERY, len(time) + 1, SHOWN_EVERY):
    line.set_data(time[:tick], height[:tick])
    if screen:
        plt.pause(SHOWN_EVERY / 200)
if screen:
    plt.show()
else:
    file = Path("runs/live_plot.png")
    file.parent.mkdir(exist_ok=True)
    figure.savefig(file)
    print(f"There is no screen; the picture is in {file}.")
