"""When a policy is rolled back, and when its training ends."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class StoppingRules:
    """Of stopping and throwing back; errors are those estimated on checks."""

    minutes: float = 10.0
    """Robot time at most."""
    tolerance: float = 0.004
    """Error that is good enough, on two checks in a row, m."""
    margin: float = 0.01
    """Error above the best at which a policy is rolled back to it, m."""
    confirm: int = 2
    """Checks in a row that must be so bad: a few hops scatter."""
    gain: float = 0.0005
    """Less of an improvement counts for none, m."""
    patience: int = 8
    """Checks without an improvement after which the training ends."""

    def rolled_back(self, errors: Sequence[float]) -> bool:
        """Tell whether the last checks are too bad beside the best.

        Args:
            errors: Of all checks since the last policy was rolled back, and of the best, m.
        """
        latest = errors[-self.confirm :]
        return len(latest) == self.confirm and min(latest) > min(errors) + self.margin

    def reason(self, errors: Sequence[float], minutes: float, following: float) -> str:
        """Return why to stop, a sentence; empty to go on.

        Args:
            errors: Of all checks in order, m.
            minutes: Robot time so far.
            following: Robot time of the next outing.
        """
        if len(errors) > 1 and max(errors[-2:]) <= self.tolerance:
            return f"The error is within {1e3 * self.tolerance:g} mm."
        if minutes + following > self.minutes + 1e-9:
            return f"The {self.minutes:g} minutes of robot time are used up."
        if self._stale(errors):
            return f"Nothing improved on the last {self.patience} checks."
        return ""

    def _stale(self, errors: Sequence[float]) -> bool:
        if len(errors) <= self.patience:
            return False
        before, since = errors[: -self.patience], errors[-self.patience :]
        return min(since) > min(before) - self.gain
