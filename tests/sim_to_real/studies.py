"""A small study to ask things of."""

from hopping_leg.sim_to_real.methods import choose_methods
from hopping_leg.sim_to_real.study import Study, find_twins


def study(folder, methods=("identified", "cad"), **options):
    twins = find_twins(["2"], folder / "twins")
    return Study(folder, twins, tuple(choose_methods(methods)), **options)
