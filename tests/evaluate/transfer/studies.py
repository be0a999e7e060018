"""A small study to ask things of."""

from hopping_leg.evaluate.transfer.methods import choose_methods
from hopping_leg.evaluate.transfer.study import Study, find_twins


def study(folder, methods=("identified", "cad"), **options):
    twins = find_twins(["2"], folder / "twins")
    return Study(folder, twins, tuple(choose_methods(methods)), **options)
