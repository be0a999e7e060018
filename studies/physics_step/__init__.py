"""How fine must the physics step be?"""

RESULTS = ("python -m studies.physics_step --json studies/physics_step/results/physics_step.json",)
