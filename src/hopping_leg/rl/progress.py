"""Show how a training goes."""

import math

from rich.progress import TextColumn, TimeRemainingColumn

from hopping_leg.progress import LiveProgress


class TrainingProgress(LiveProgress):
    """Live numbers of a training, as a context manager.

    Args:
        title: What is trained.
        quiet: Show nothing.
    """

    def __init__(self, title: str, *, quiet: bool = False) -> None:
        super().__init__(title, columns=(TextColumn("left"), TimeRemainingColumn()), quiet=quiet)
        self._title = title
        self._first_steps: int | None = None

    def update(self, share: float, steps: int, hops: int, error: float, best: str) -> None:
        """Show the state of the training.

        Args:
            share: Of the budget that is used, 0 to 1.
            steps: Control steps so far.
            hops: Hops so far.
            error: Mean |apex - command| of the latest hops, m; NaN before the first.
            best: About the best snapshot.
        """
        if self._first_steps is None:
            self._first_steps = steps
        note = f"{hops} hops"
        if math.isfinite(error):
            note += f" · apex error {1000 * error:.0f} mm"
        if steps > self._first_steps:
            note += f" · {(steps - self._first_steps) / max(self.passed, 1e-9):.0f} steps/s"
        note += best
        self._bar.update(self._task, completed=share, note=note)
        self._line_if_due(f"{self._title} {100 * share:.0f} % · {note}")
