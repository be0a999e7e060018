"""All skills of all entries, as JSON values."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from hopping_leg.controllers import RolloutConfig
from hopping_leg.errors import UsageError
from hopping_leg.evaluate import runner, trials
from hopping_leg.evaluate.entries import Entry, check_labels, check_range
from hopping_leg.evaluate.skills import counted, landings
from hopping_leg.evaluate.skills.stairs import STAIRS, climb

SCHEMA = 1
"""Version of the JSON, raised when a name changes its meaning."""


def run_skills(
    entries: Sequence[Entry],
    setup: RolloutConfig,
    *,
    floors: Sequence[str] = ("soft", "stiff"),
    commands: Sequence[float] | None = None,
    repeats: int = 5,
    seed: int = 1000,
    on_progress: Callable[[str, float], None] = lambda _label, _share: None,
) -> dict[str, Any]:
    """Let every entry hop so many times and stop, and over stairs; drop a leg.

    Floors are named as in ``evaluate.trials.FLOORS``; commands are the paper's by default.

    Returns:
        ``counted``, ``stairs``, ``climbs``, ``landings``, ``conditions``, ``versions``, ``notes``.

    Raises:
        UsageError: A command is out of reach or of an entry's range, or the engine is not the
            stepper.
    """
    if setup.engine != "stepper":
        raise UsageError("Stairs and drops need the engine stepper; leave --engine out.")
    trials.check_repeats(repeats)
    chosen = trials.choose_commands(setup.robot, commands)
    check_labels(entries)
    for entry in entries:
        check_range(entry, chosen)
    size = setup.robot.size
    stairs, drop = [size * level for level in STAIRS], size * landings.DROP
    tables: dict[str, list[dict[str, Any]]] = {}

    def add(name: str, found: Iterable[Any], **where: str) -> None:
        tables.setdefault(name, []).extend({**where, **vars(row)} for row in found)

    for entry in entries:
        for number, floor in enumerate(floors):
            what = (entry.controller, trials.on_floor(setup, floor), chosen)
            where = {"controller": entry.label, "floor": floor}
            add("counted", counted.count_hops(*what, repeats=repeats, seed=seed), **where)
            on_progress(entry.label, (number + 0.5) / len(floors))
            steps, wholes = climb(*what, stairs=stairs, repeats=repeats, seed=seed)
            add("stairs", steps, **where)
            add("climbs", wholes, **where)
            on_progress(entry.label, (number + 1) / len(floors))
    for floor in floors:
        landed = landings.land(trials.on_floor(setup, floor), drop=drop, repeats=repeats, seed=seed)
        add("landings", landed, floor=floor)
    return {
        "schema": SCHEMA,
        **tables,
        "conditions": {
            **runner.setup_conditions(setup),
            "commands_m": chosen,
            "counts": counted.COUNTS,
            "stairs_m": stairs,
            "drop_m": drop,
            "floors": list(floors),
            "seeds": repeats,
            "seed": seed,
        },
        "versions": runner.software_versions(),
        "notes": [note for entry in entries for note in entry.notes],
    }
