"""Robot files with other numbers."""

import copy

from hopping_leg.robot import load_tree, numbers, robot_text

UNITS = {path: entry["unit"] for path, entry in numbers(load_tree("legv2"))}


def written(path, text, extends="legv2-paper"):
    """Write numbers ``{path: (value, unit)}`` as a robot file that extends another."""
    lines = [f'name = "mine"\nextends = "{extends}"']
    for number, (value, unit) in text.items():
        lines.append(f'{number} = {{ value = {value}, unit = "{unit}", source = "test" }}')
    path.write_text("\n".join(lines))
    return str(path)


def whole(path, change):
    """Write legv2 after a change of its tables as a file that stands alone."""
    tree = copy.deepcopy(load_tree("legv2"))
    change(tree)
    path.write_text(robot_text(tree))
    return str(path)
