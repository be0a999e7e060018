"""The paper's figures, each drawn from traces or an evaluation alone."""

from hopping_leg.evaluate.figures.results import (
    draw_distributions,
    draw_ladder,
    draw_learning,
    draw_robustness,
)
from hopping_leg.evaluate.figures.runs import draw_estimate, draw_heights, draw_phase_space
from hopping_leg.figure_style import to_png, to_svg

__all__ = [
    "draw_distributions",
    "draw_estimate",
    "draw_heights",
    "draw_ladder",
    "draw_learning",
    "draw_phase_space",
    "draw_robustness",
    "to_png",
    "to_svg",
]
