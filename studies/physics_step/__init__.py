"""How fine must the physics step be?"""

RESULTS = ("python -m studies.physics_step --json studies/physics_step/results/physics_step.json",)

TABLES = (
    (
        "table",
        "physics_step.json",
        "converged",
        "controller",
        "robot",
        "timestep_s*1000=converged at, ms",
    ),
    (
        "table",
        "physics_step.json",
        "variants",
        "variant",
        "robot",
        "largest_median_shift_m*1000=median, mm",
        "largest_std_change_m*1000=std, mm",
    ),
)
