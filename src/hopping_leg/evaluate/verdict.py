"""What an evaluation says of each controller, in one sentence."""

from collections.abc import Sequence
from statistics import median

from hopping_leg.evaluate.result import Evaluation, Summary


def verdict(evaluation: Evaluation, controller: str) -> str:
    """Return how near it hops to its commands, what it skips and touches, and on another floor.

    Heights between and beyond the commands count, too.
    """
    rows = evaluation.rows(controller)
    rows += [row for row in evaluation.ladder if row.controller == controller]
    errors = {row: abs(row.median_error_m) for row in rows if row.hops}
    if not errors:
        return "does not hop at any height."
    worst = max(errors, key=errors.__getitem__)
    parts = [
        f"misses its command by {_mm(median(errors.values()))} in the median of"
        f" {len({row.command_m for row in rows})} heights and by {_mm(errors[worst])} at the worst,"
        f" {worst.command_m:.2f} m"
    ]
    if still := sorted({row.command_m for row in rows} - {row.command_m for row in errors}):
        parts.append(f"does not hop at {', '.join(f'{command:.2f}' for command in still)} m")
    parts += [_skipped(rows), _contacts(sum(row.body_contacts for row in rows))]
    other = evaluation.secondary
    if other is not None and (there := [r for r in other.rows(controller) if r.hops]):
        most = max(abs(row.median_error_m) for row in there)
        parts.append(f"on the {other.conditions['floor']} floor misses by {_mm(most)} at the worst")
    return f"{'; '.join(parts)}."


def _skipped(rows: Sequence[Summary]) -> str:
    skipped, hops = (sum(getattr(r, name) for r in rows) for name in ("skipped_hops", "hops"))
    return f"skips {skipped} of {skipped + hops} hops" if skipped else "skips no hop"


def _contacts(count: int) -> str:
    times = "once" if count == 1 else f"{count} times"
    return f"base or knee touch the ground {times}" if count else "only the foot touches the ground"


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.1f} mm"
