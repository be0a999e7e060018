"""How fast are environment, policies, viewer and control loop?"""

RESULTS = (
    "python -m studies.speed env --json studies/speed/results/env.json",
    "python -m studies.speed inference --json studies/speed/results/inference.json",
    "python -m studies.speed view --json studies/speed/results/view.json",
    "python -m studies.speed deploy --json studies/speed/results/deploy.json",
)
