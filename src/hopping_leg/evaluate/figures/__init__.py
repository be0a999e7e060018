"""The paper's figures, each drawn from traces or an evaluation alone."""

from hopping_leg.evaluate.figures.distributions import draw_distributions
from hopping_leg.evaluate.figures.estimate import draw_estimate
from hopping_leg.evaluate.figures.heights import draw_heights
from hopping_leg.evaluate.figures.ladder import draw_ladder
from hopping_leg.evaluate.figures.learning import draw_learning
from hopping_leg.evaluate.figures.phase_space import draw_phase_space
from hopping_leg.evaluate.figures.robustness import draw_robustness
from hopping_leg.evaluate.figures.style import to_png, to_svg

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
