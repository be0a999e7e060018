"""Traces that are quickly made."""

import numpy as np
import polars as pl

from hopping_leg.robot import load_robot
from hopping_leg.trace import COLUMNS, Trace


def noise(rows=40, seed=0, rate=200.0, robot="legv2", command=0.3):
    """Return a trace of random numbers, all columns there."""
    rng = np.random.default_rng(seed)
    columns = {name: rng.normal(size=rows) for name in COLUMNS}
    columns |= {"time_s": np.arange(rows) / rate, "command_m": np.full(rows, command)}
    header = {"robot": robot, "robot_digest": load_robot(robot).digest, "rate_hz": rate}
    return Trace(pl.DataFrame(columns), header)
