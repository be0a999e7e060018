"""Height as a controller estimates it beside the true one."""

import numpy as np
from matplotlib.figure import Figure

from hopping_leg.evaluate.estimator import HEIGHT
from hopping_leg.evaluate.figures.style import COLOURS, WIDTH, styled
from hopping_leg.evaluate.metrics import START_SECONDS
from hopping_leg.trace import Trace

SHOWN_SECONDS = 3.0


@styled
def draw_estimate(trace: Trace, title: str = "") -> Figure:
    """Draw estimate and truth over a few hops, and the error over the whole run.

    Args:
        trace: A run whose controller records ``estimated_height_m``.
        title: Of the figure.
    """
    time, height, estimate = (trace.column(n) for n in ("time_s", "height_m", HEIGHT))
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    over_time, spread = figure.subplots(1, 2, width_ratios=(2, 1))
    shown = (time >= START_SECONDS) & (time < START_SECONDS + SHOWN_SECONDS)
    over_time.plot(time[shown], height[shown], color=COLOURS[0], label="true")
    over_time.plot(time[shown], estimate[shown], "--", color=COLOURS[1], label="estimated")
    over_time.set(xlabel="time / s", ylabel="base height / m")
    over_time.margins(y=0.15)
    over_time.legend(loc="upper right", ncols=2)
    settled = time >= START_SECONDS
    flight = trace.column("foot_clearance_m") > 0
    error = 1e3 * (estimate - height)
    known = settled & np.isfinite(error)
    bins = np.linspace(error[known].min() - 1, error[known].max() + 1, 50)
    for name, phase, paint in (
        ("flight", known & flight, COLOURS[0]),
        ("stance", known & ~flight, COLOURS[1]),
    ):
        spread.hist(error[phase], bins=bins, histtype="step", density=True, color=paint, label=name)
    spread.set(xlabel="estimated - true / mm", ylabel="density / (1/mm)")
    spread.legend()
    over_time.set_title(title)
    return figure
