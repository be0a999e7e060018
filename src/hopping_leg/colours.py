"""One colour for each controller: in figures, reports, videos, the viewer and the live page."""

from collections.abc import Iterable

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's palette, distinct for all common kinds of colour blindness."""

COMMAND = "#737373"
"""Of commanded heights."""

_OF_CONTROLLERS = {
    "precise": "#0072B2",
    "energy-shaping": "#D55E00",
    "fast": "#009E73",
    "universal": "#CC79A7",
    "energy-shaping-flying": "#E69F00",
    "energy-shaping-literal": "#8C510A",
    "mpc-true-state": "#8A7A00",
    "paper": "#7A5AA6",
}
"""Of the shipped ones, whatever stands beside them."""


def controller_colours(names: Iterable[str]) -> dict[str, str]:
    """Return the colour of each controller as ``#rrggbb``: its own, else the next that is free."""
    shown = list(dict.fromkeys(names))
    found = {name: _OF_CONTROLLERS[name] for name in shown if name in _OF_CONTROLLERS}
    free = [colour for colour in COLOURS if colour not in found.values()] or list(COLOURS)
    others = [name for name in shown if name not in found]
    found |= {name: free[index % len(free)] for index, name in enumerate(others)}
    return {name: found[name] for name in shown}


def rgb(colour: str) -> tuple[int, int, int]:
    """Return a colour ``#rrggbb`` as numbers from 0 to 255."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue
