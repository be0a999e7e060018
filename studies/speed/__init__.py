"""How fast are environment and control loop?"""

RESULTS = (
    "python -m studies.speed env --json studies/speed/results/env.json",
    "python -m studies.speed deploy --json studies/speed/results/deploy.json",
)
