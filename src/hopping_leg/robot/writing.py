"""Robot tables back into a file, in the form that people write by hand: a number a line."""

import json
from typing import Any

from hopping_leg.robot.fields import Tree


def robot_text(tree: Tree, comment: str = "") -> str:
    """Return robot tables as TOML.

    Args:
        tree: The tables; numbers are ``{value, unit, source}``.
        comment: Put above all, line by line.
    """
    lines = [f"# {line}".rstrip() for line in comment.splitlines()]
    _write(tree, "", lines)
    return "\n".join(lines).strip("\n") + "\n"


def _write(tree: Tree, prefix: str, lines: list[str]) -> None:
    plain = {k: v for k, v in tree.items() if not isinstance(v, dict) or "value" in v}
    if prefix and plain:
        lines += ["", f"[{prefix}]"]
    lines += [f"{key} = {_text(value)}" for key, value in plain.items()]
    for key, value in tree.items():
        if key not in plain:
            _write(value, f"{prefix}.{key}" if prefix else key, lines)


def _text(value: Any) -> str:  # noqa: ANN401
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_text(v)}" for k, v in value.items()) + " }"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value)
