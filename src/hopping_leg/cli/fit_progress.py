"""Show how an identification goes."""

from hopping_leg.progress import LiveProgress, minutes

_FIRST_LINE = 60.0


class FitProgress(LiveProgress):
    """Stage, share done, time left and cost of a fit, as a context manager."""

    def __init__(self) -> None:
        super().__init__("preparing", first_line=_FIRST_LINE)

    def update(self, stage: str, share: float, cost: float) -> None:
        """Show the state of the fit.

        Args:
            stage: What is being done.
            share: Done of all, 0 to 1.
            cost: Lowest so far.
        """
        left = (
            f" · at most {minutes(self.passed * (1 - share) / share)} left" if 0 < share < 1 else ""
        )
        note = f"cost {cost:.5g}{left}"
        self._bar.update(self._task, description=stage, completed=share, note=note)
        self._line_if_due(f"{stage} {100 * share:.0f} % · {note}")
