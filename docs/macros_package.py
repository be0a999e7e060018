"""Tables of what the package itself knows: robots, ranges, axes, faults."""

import ast
import dataclasses
import inspect
import itertools
import math
import textwrap
from typing import Any

from macros_results import grid, number
from studies.fault_campaign.families import FAMILIES

from hopping_leg.cli.robots import derived
from hopping_leg.emulator.faults import KINDS
from hopping_leg.evaluate.robustness_axes import AXES
from hopping_leg.robot import load_robot, load_tree, numbers
from hopping_leg.sim.randomization import TWIN_RANGES
from hopping_leg.trace import COLUMNS


def robot(name: str) -> str:
    """Return every number of a shipped robot as a table."""
    leg = load_robot(name)
    rows = [
        [f"`{path}`", f"{entry['value']:g}", entry["unit"], entry["source"]]
        for path, entry in numbers(load_tree(name))
    ]
    rows += [[f"`{path}`", number(entry), "", "computed"] for path, entry in derived(leg).items()]
    return grid(["number", "value", "unit", "source"], rows)


def trace_columns() -> str:
    """Return the columns that every trace has as a table; units are the ends of their names."""
    units = {"_m_s": "m/s", "_rad_s": "rad/s", "_rad": "rad", "_nm": "N m", "_s": "s", "_m": "m"}
    rows = [
        [f"`{name}`", next(unit for end, unit in units.items() if name.endswith(end)), meaning]
        for name, meaning in COLUMNS.items()
    ]
    return grid(["column", "unit", "meaning"], rows)


def hyperparameters(
    recipe: str, base: str | None = None, *, part: str = "", without: str = " "
) -> str:
    """Return the options of a recipe as a table.

    Args:
        recipe: Its name.
        base: Leave out what this recipe has alike.
        part: Show only options whose names begin so.
        without: Show no options whose names begin so.
    """
    from hopping_leg.rl.recipes import get_recipe

    shown, usual = get_recipe(recipe), get_recipe(base) if base else None
    theirs = dict(usual.paths()) if usual else {}
    rows = []
    for name, path in shown.paths():
        found, owner = shown.value(name), shown
        if not name.startswith(part) or name.startswith(without):
            continue
        if name in theirs and usual is not None and usual.value(name) == found:
            continue
        for step in path.split(".")[:-1]:
            owner = getattr(owner, step)
        if name == "task.randomised":
            found = [r.path for r in found]
        elif dataclasses.is_dataclass(found):
            continue
        meaning = _meaning(type(owner), path.split(".")[-1])
        rows.append([f"`{name}`", number(_plain(found)), meaning])
    return grid(["option", "value", "meaning"], rows)


def _plain(found: Any) -> Any:  # noqa: ANN401
    return [_plain(one) for one in found] if isinstance(found, tuple | list) else found


def _meaning(kind: type, name: str) -> str:
    """Return the docstring of a dataclass's field, on one line."""
    tree: Any = ast.parse(textwrap.dedent(inspect.getsource(kind)))
    for entry, text in itertools.pairwise(tree.body[0].body):
        if isinstance(entry, ast.AnnAssign) and ast.unparse(entry.target) == name:
            return inspect.cleandoc(text.value.value).replace("\n", " ").replace("``", "`")
    return ""


def stages(recipe: str) -> str:
    """Return the stages of a distillation and what each has to reach as a table."""
    from hopping_leg.rl.recipes import get_recipe
    from hopping_leg.rl.stages import stages_of

    rows = [
        [one.name, f"{100 * one.until:g} %", one.score, f"{1000 * one.must_score:g}"]
        for one in stages_of(get_recipe(recipe))
    ]
    return grid(["stage", "until", "score", "at most, mm"], rows)


def twin_ranges() -> str:
    """Return the distribution of twins as a table."""
    rows = [
        [f"`{r.path}`", f"{r.low:g}", f"{r.high:g}", r.unit, r.scale, r.source] for r in TWIN_RANGES
    ]
    return grid(["number", "from", "to", "unit", "scale", "source"], rows)


def robustness_axes() -> str:
    """Return the axes of the robustness benchmark as a table."""
    rows = [
        [
            f"`{axis.name}`",
            axis.meaning,
            "" if axis.unit == "1" else axis.unit,
            ", ".join(f"{level:g}" for level in axis.levels),
            axis.leaderboard,
            "{:g} to {:g}".format(*axis.moderate),
        ]
        for axis in AXES
    ]
    return grid(["axis", "a level is", "unit", "levels", "R", "in `joint`"], rows)


def fault_kinds() -> str:
    """Return what a fault script may name as a table."""
    rows = []
    for name, kind in KINDS.items():
        value = f"{kind.value:g} {kind.unit}" if kind.unit else ""
        if math.isnan(kind.duration):
            lasts = "`count` replies"
        else:
            lasts = "on" if math.isinf(kind.duration) else f"{kind.duration:g} s"
        rows.append([f"`{name}`", kind.text, value, lasts])
    return grid(["kind", "what happens", "value by default", "lasts"], rows)


def fault_families() -> str:
    """Return the campaign's families and for which reasons a run may end as a table."""
    rows = []
    for name, family in FAMILIES.items():
        reasons = ", ".join(sorted(reason.name for reason in family.reasons))
        nothing = "not armed" if family.refused else "the drives brake"
        rows.append([name, f"`{reasons}`" if reasons else nothing])
    return grid(["family", "correct ends"], rows)


MACROS = {
    "fault_families": fault_families,
    "fault_kinds": fault_kinds,
    "hyperparameters": hyperparameters,
    "robot": robot,
    "robustness_axes": robustness_axes,
    "stages": stages,
    "trace_columns": trace_columns,
    "twin_ranges": twin_ranges,
}
