"""How fast are environment, policies, viewer and control loop?"""

RESULTS = (
    "python -m studies.speed env --json studies/speed/results/env.json",
    "python -m studies.speed inference --json studies/speed/results/inference.json",
    "python -m studies.speed view --json studies/speed/results/view.json",
    "python -m studies.speed deploy --json studies/speed/results/deploy.json",
)

TABLES = (
    (
        "table",
        "env.json",
        "",
        "batched_env_steps_per_s=batched steps/s",
        "batched_env_over_bare_physics=over bare physics",
        "single_env_cost_over_bare_physics=cost of a single step over bare physics",
        "single_env_over_hopper_v5=single over Hopper-v5",
    ),
    (
        "table",
        "inference.json",
        "rows",
        "policy",
        "inference_median_us=median, µs",
        "inference_p99_us=p99, µs",
    ),
)
