"""Run the paper's sim-to-real experiment on twins: record, identify, train, hop.

A twin plays the real leg: it differs from the CAD in what a fit can find and in what no fit knows.
`transfer` records and identifies it, trains a policy on what was identified and lets it hop on the
twin without tuning. In `zero-shot` controllers hop on legs that they have never met. What is done
stays in a folder: the same command goes on after an interruption, and more twins, methods or seeds
add to what is there.

Examples:
  python -m studies.sim_to_real transfer --json transfer.json
  python -m studies.sim_to_real zero-shot --controllers universal energy-shaping --twins 100
"""

RESULTS = (
    "python -m studies.sim_to_real zero-shot --controllers universal energy-shaping-tuned "
    "energy-shaping --twins 30 --seed 6000 --disturbance on off --jobs 2 "
    "--out runs/zero-shot-twins --json studies/sim_to_real/results/zero_shot_twins.json",
    "python -m studies.time_to_accuracy --recipes universal --seeds 0 1 2 "
    "--out runs/time_to_accuracy && "
    "hop train --recipe universal-small --threads 2 --seed 0 --out runs/small && cd runs/small && "
    "python ../../examples/microcontroller.py policy.onnx && cd ../.. && "
    "python -m studies.sim_to_real zero-shot --controllers universal "
    "runs/time_to_accuracy/universal-1/1/policy.onnx "
    "runs/time_to_accuracy/universal-2/1/policy.onnx runs/small/small.onnx energy-shaping-tuned "
    "--twins 20 --seed 7000 --jobs 2 --out runs/zero-shot-seeds "
    "--json studies/sim_to_real/results/zero_shot_seeds.json",
    "hop robots draw legs --count 50 --seed 6000 --out runs/legs && "
    "python -m studies.sim_to_real zero-shot --controllers universal energy-shaping-tuned "
    "energy-shaping --folder runs/legs --jobs 2 --out runs/zero-shot-legs "
    "--json studies/sim_to_real/results/zero_shot_legs.json",
    *(
        "python -m studies.sim_to_real zero-shot --controllers universal energy-shaping-tuned "
        f"--twins 20 --seed 8000 --{option} --jobs 2 --out runs/zero-shot-{name} "
        f"--json studies/sim_to_real/results/zero_shot_{name}.json"
        for name, option in (("friction", "friction 1.5"), ("weak_hip", "hip-gain 0.49"))
    ),
    *(
        "python -m studies.sim_to_real transfer --methods identified-belt identified two-pass cad "
        "table-1 randomised energy-shaping-identified --seeds 0 1 2 "
        f"--disturbance {noise} --jobs 2 --folder runs/transfer-fast "
        f"--json studies/sim_to_real/results/fast_noise_{noise}.json"
        for noise in ("on", "off")
    ),
)
