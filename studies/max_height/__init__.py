"""How high could the leg hop with its torques?"""

RESULTS = ("python -m studies.max_height --json studies/max_height/results/max_height.json",)
