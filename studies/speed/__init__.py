"""How fast are environment, policies, viewer and control loop?"""

RESULTS = (
    "python -m studies.speed env --json studies/speed/results/env.json",
    "python -m studies.speed identify --json studies/speed/results/identify.json",
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
        "batched_env_overhead_s*1000000=overhead of a batched step, µs",
        "single_env_step_s*1000000=single step, µs",
        "stepper_step_s*1000000=physics step, µs",
        "stepper_over_mujoco=stepper over MuJoCo",
        "stepper_with_effects_over_mujoco=with every effect",
    ),
    (
        "table",
        "identify.json",
        "",
        "fixed_base_candidate_s=a candidate, 240 s on a fixed base, one thread, s",
        "two_pass_s=the paper's two passes over 480 s, s",
        "short_identification_s=identification of 12 s, s",
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
