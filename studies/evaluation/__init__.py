"""Results of `hop evaluate` for the shipped controllers."""

_HEIGHTS = ",".join(f"{0.22 + 0.01 * step:.2f}" for step in range(20))
"""Heights from 0.22 to 0.41 m."""

_BASELINES, _TUNED = "energy-shaping energy-shaping-flying", "energy-shaping energy-shaping-tuned"

_FRESH = 2000
"""First seed of trials that no choice of the recipe `universal` has seen."""


def _trials(controllers: str, name: str, options: str) -> str:
    return f"hop evaluate {controllers} {options} --json studies/evaluation/results/{name}"


def _every_cm(name: str, options: str = "") -> str:
    options = f"--seeds 5 --floor soft --commands {_HEIGHTS} {options}".strip()
    return _trials(f"rl fast {_BASELINES}", f"{name}.json", options)


def _universal(robot: str) -> str:
    """Return the command that evaluates `universal` on a robot, beside energy shaping."""
    options = f"--seeds 5 --seed {_FRESH} --robot {robot}"
    return _trials("universal energy-shaping", f"universal_{robot}.json", options)


def _calm() -> str:
    """Return the command that trains `rl` with prices on power and says what a hop costs then."""
    asked = [(price, seed) for price in (0.0, 0.05, 0.15, 0.4) for seed in (0, 1)]
    runs = {f"runs/calm-{price}-{seed}": (price, seed) for price, seed in asked}
    trained = [
        f"hop train --recipe rl --set reward.power={price} --seed {seed} --out {run}"
        for run, (price, seed) in runs.items()
    ]
    policies = " ".join(f"{run}/policy.onnx" for run in runs)
    options = f"--floor soft --commands 0.3 --seeds 9 --seed {_FRESH}"
    return " && ".join([*trained, _trials(policies, "calm.json", options)])


LEGS = ("legv2-identified", "legv2", "legv2-paper", "legv1")
"""Robots on which `universal` is evaluated."""

RESULTS = (
    _trials(
        f"rl fast universal {_BASELINES} energy-shaping-literal", "evaluation.json",
        "--seeds 10 --floor soft --traces runs/results/traces",
    ),
    "hop report runs/results/traces/*.parquet --out studies/evaluation/figures",
    _trials(f"paper {_BASELINES} energy-shaping-literal", "paper.json", "--seeds 10"),
    _trials(f"rl fast universal {_TUNED}", "cost.json", f"--floor soft --seeds 3 --seed {_FRESH}"),
    _trials(f"paper {_TUNED}", "cost_paper.json", f"--floor soft --seeds 3 --seed {_FRESH}"),
    _calm(),
    *(_universal(robot) for robot in LEGS),
    _every_cm("every_cm"),
    _every_cm("every_cm_fine_step", "--timestep 3.125e-05"),
    _every_cm("every_cm_no_soft_limits", "--no-soft-limits"),
    f"hop evaluate fast universal {_TUNED} --seeds 3 --seed {_FRESH} "
    "--suite robustness --out runs/results/robustness "
    "--json studies/evaluation/results/robustness.json",
    "cp runs/results/robustness/robustness.svg studies/evaluation/figures",
    f"hop evaluate paper {_BASELINES} --seeds 3 --suite robustness "
    "--out runs/results/paper_robustness --json studies/evaluation/results/paper_robustness.json",
)  # fmt: skip
