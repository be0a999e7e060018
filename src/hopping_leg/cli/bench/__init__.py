"""Measure speed, convergence and accuracy; every number can be written as JSON.

Examples:
  hop bench env --json env.json
  hop bench convergence --json convergence.json
  hop bench inference fast --json inference.json
  hop bench reach --json reach.json
  hop bench limits --teacher runs/precise-seed0 --json limits.json
  hop bench training --training-seeds 0 1 2 --json training.json
  hop bench faults --json faults.json
  hop bench deploy --json deploy.json
  hop bench energy-shaping --json energy_shaping.json
  hop bench engines --json bullet.json
  hop bench probe fast paper --json probe.json --figure probe.svg
  hop bench identify --skip-paper-size --json identify.json
  hop bench view --json view.json
  hop bench finetune --json finetune.json --figure finetune.svg
"""

from hopping_leg.cli.bench.controllers import Ablation, EnergyShaping, Training
from hopping_leg.cli.bench.engines import Engines
from hopping_leg.cli.bench.faults import Faults
from hopping_leg.cli.bench.finetuning import Finetune
from hopping_leg.cli.bench.hardware import Deploy
from hopping_leg.cli.bench.identification import Identify
from hopping_leg.cli.bench.limits import Limits
from hopping_leg.cli.bench.probe import Probe
from hopping_leg.cli.bench.simulation import Convergence, Env, Inference, Reach
from hopping_leg.cli.bench.view import View
from hopping_leg.cli.command_line import KEPT, command_line, verb_of
from hopping_leg.io import write_json

Benchmark = (
    Env
    | Convergence
    | Inference
    | Reach
    | Limits
    | EnergyShaping
    | Training
    | Ablation
    | Faults
    | Deploy
    | Identify
    | Engines
    | View
    | Probe
    | Finetune
)


def run(args: Benchmark) -> None:
    """Run one benchmark, print its numbers, write the JSON."""
    command = command_line(f"hop bench {verb_of(args)}", args, KEPT | {"recordings"})
    result = {"command": command, **args.measure()}
    if args.json is not None:
        write_json(args.json, result)
        print(f"Wrote {args.json}.")
