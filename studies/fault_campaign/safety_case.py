"""The safety case: what each fault is noticed by, and how surely, from the campaign's own data."""

from typing import Any

from studies.fault_campaign.families import FAMILIES, Family

_CONFIDENCE = 0.95


def upper_bound(trials: int, failures: int) -> float | None:
    """Return the 95 % upper bound of a failure rate without failures; None with any, or no trial.

    Of n trials without a failure it is 1 - 0.05^(1/n).
    """
    return None if failures or not trials else 1 - (1 - _CONFIDENCE) ** (1 / trials)


def rows(*campaigns: dict[str, Any]) -> list[dict[str, Any]]:
    """Return a row per family: what happens, what notices it, what follows, how often it was tried.

    Args:
        campaigns: Results; of a family that several have tried the last counts.
    """
    tried = {row["family"]: row for campaign in campaigns for row in campaign["rows"]}
    none = {"trials": 0, "unsafe": 0, "reaction_p99_s": None, "braked_max_s": None}
    return [_row(family, tried.get(name, none)) for name, family in FAMILIES.items()]


def _row(family: Family, tried: dict[str, Any]) -> dict[str, Any]:
    reasons = sorted(reason for reason in family.reasons if reason.name != "FINISHED")
    goes_on = any(reason.name == "FINISHED" for reason in family.reasons)
    if family.refused:
        noticed, follows = "the checks before arming", "the leg is not armed"
    elif family.lies:
        noticed = "what a drive says, against itself and against what it was told"
        follows = "the drives brake, or it hops on unharmed"
    elif family.name == "no fault":
        noticed, follows = "nothing may be", "it hops or stands for ten seconds"
    elif family.name == "killed host":
        noticed, follows = "the drives' watchdogs", "the drives brake by themselves"
    else:
        noticed = " ".join(reason.sentence for reason in reasons) or "nothing needs to"
        follows = "the leg does not hop" if family.grounded else "the drives brake"
        follows = f"{follows}, or it hops on" if goes_on and reasons else follows
        follows = "it hops on" if goes_on and not reasons else follows
    seconds = tried["braked_max_s"] or tried["reaction_p99_s"]
    return {
        "fault": family.name,
        "noticed_by": noticed,
        "follows": follows,
        "within_s": seconds,
        "trials": tried["trials"],
        "unsafe": tried["unsafe"],
        "upper_bound": upper_bound(tried["trials"], tried["unsafe"]),
        "test": f"python -m studies.fault_campaign --families '{family.name}'",
    }
