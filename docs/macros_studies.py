"""Tables of single studies in docs/results that need more than columns picked."""

from typing import Any

from macros_results import grid, number, origin, read


def leaderboard(file: str) -> str:
    """Return the scores of a robustness file: a row per axis, a column per controller, in %."""
    content = read(file)
    controllers = list(dict.fromkeys(row["controller"] for row in content["scores"]))
    cells = {(row["axis"], row["controller"]): _share(row) for row in content["scores"]}
    rows = [
        [f"`{axis}`", *(cells[axis, name] for name in controllers)]
        for axis in dict.fromkeys(axis for axis, _ in cells)
    ]
    return grid(["axis", *controllers], rows) + origin(file, content)


def _share(row: dict[str, Any]) -> str:
    score, low, high = (f"{100 * row[key]:.0f}" for key in ("score", "low", "high"))
    return f"{score} [{low}, {high}]"


def recoveries(file: str) -> str:
    """Return how controllers recover in a robustness file: a row per change, the worst command.

    The last rows count changes and commands after which they are back.
    """
    content = read(file)
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in content["recovery"]:
        groups.setdefault((row["change"], row["controller"]), []).append(row)
    controllers = list(dict.fromkeys(controller for _, controller in groups))
    rows = [
        [change, *(_recovered(groups[change, name]) for name in controllers)]
        for change in dict.fromkeys(change for change, _ in groups)
    ]
    for title, entry in (
        ("back, of all changes and commands", "back_after_hops"),
        ("in the median of the hops' errors", "centred_after_hops"),
    ):
        rows.append([title, *(_backs(content, entry, name) for name in controllers)])
    return grid(["change", *controllers], rows) + origin(file, content)


def _recovered(rows: list[dict[str, Any]]) -> str:
    first = _worst([error for row in rows for error in row["hop_abs_errors_m"]], 1000)
    later = _worst([row["later_abs_error_m"] for row in rows], 1000)
    return f"{_worst([row['back_after_hops'] for row in rows])} [{first}, {later}]"


def _backs(content: dict[str, Any], entry: str, controller: str) -> str:
    hops = [row[entry] for row in content["recovery"] if row["controller"] == controller]
    return f"{sum(one is not None for one in hops)} of {len(hops)}"


def _worst(values: list[float | None], factor: float = 1) -> str:
    """Return the largest; what does not exist is worse than any number."""
    known = [value for value in values if value is not None]
    return number(round(factor * max(known))) if len(known) == len(values) else number(None)


def probe_scores(file: str, controller: str) -> str:
    """Return a policy's probes: a row per set of features, a column per target."""
    content = read(file)
    own = [row for row in content["rows"] if row["controller"] == controller]
    targets = list(dict.fromkeys(row["target"] for row in own))
    cells = {(row["features"], row["target"]): _scored(row) for row in own}
    rows = [
        [features, *(cells[features, target] for target in targets)]
        for features in dict.fromkeys(row["features"] for row in own)
    ]
    return grid(["read off", *targets], rows) + origin(file, content)


def _scored(row: dict[str, Any]) -> str:
    error = "" if row["rms"] is None else f", {row['rms']:.2g} {row['unit']}"
    return f"{row['score']:.2f} [{row['low']:.2f}, {row['high']:.2f}]{error}"


def percentiles(file: str, **titles: str) -> str:
    """Return entries that hold percentiles as a table, a line each.

    Args:
        file: In docs/results.
        titles: Entry to what is measured.
    """
    content = read(file)
    names = list(content[next(iter(titles))])
    rows = [[title, *(number(content[entry][n]) for n in names)] for entry, title in titles.items()]
    return grid(["", *names], rows) + origin(file, content)


MACROS = {
    "leaderboard": leaderboard,
    "percentiles": percentiles,
    "probe_scores": probe_scores,
    "recoveries": recoveries,
}
