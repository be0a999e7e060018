"""How fine must the physics step be?"""

RESULTS = ("python -m studies.physics_step --json studies/physics_step/results/physics_step.json",)

TABLES = (
    (
        "table",
        "physics_step.json",
        "",
        "largest_step_for_judging_s*1000=step to judge, ms",
        "judging_tolerance_m*1000=tolerance, mm",
        "largest_step_for_training_s*1000=step to train, ms",
        "training_tolerance_m*1000=tolerance, mm",
    ),
)
