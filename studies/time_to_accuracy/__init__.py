"""How long does it take from scratch to accurate hopping?"""

RESULTS = (
    *(
        f"python -m studies.time_to_accuracy --recipes {recipes} --seeds {seeds} --json "
        f"studies/time_to_accuracy/results/{name}.json"
        for name, recipes, seeds in (
            ("rl", "rl", "0 1 2 3 4"),
            ("distillation", "fast", "0 1 2 3 4"),
            ("paper", "paper", "0 1 2 3 4"),
            ("paper_ppo", "paper-ppo paper-ppo-no-soft-limits", "0 1"),
            ("libraries", "sb3-ppo sb3-sac sbx-ppo sbx-sac sbx-tqc", "0 1 2 3 4"),
            ("universal", "universal", "0 1 2"),
        )
    ),
    "python -m studies.time_to_accuracy --recipes --figure "
    "studies/time_to_accuracy/figures/time_to_accuracy.svg",
)
