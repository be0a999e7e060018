"""Watch the best policy hop beside energy shaping, the classical controller, in the browser.

Change the height, push the legs, put a payload on them; `hop view` shows other controllers, legs
and recordings. On a server, open the printed address through `ssh -L 8080:localhost:8080`.

Examples:
  hop demo
  hop demo --no-browser
"""

from dataclasses import dataclass

from hopping_leg.cli import view

BEST = "universal"
"""The shipped policy that hops on any leg, changed ones included."""


@dataclass(frozen=True)
class Demo:
    """Where the page is."""

    port: int = view.View.port
    """Port of this computer alone; if it is in use, the next free one."""
    browser: bool = True
    """Open the page where there is a screen."""
    seconds: float = float("inf")
    """Time after which the page closes, s."""


def run(args: Demo) -> None:
    """Serve the page until Ctrl-C."""
    from hopping_leg.controllers.registry import ENERGY_SHAPING

    shown = (BEST, ENERGY_SHAPING)
    view.run(view.View(shown, None, port=args.port, browser=args.browser, seconds=args.seconds))
