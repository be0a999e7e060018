"""Continue a policy's training on a robot: trials, checks, learning, the best one kept.

A check is a trial without exploration at fixed heights; its error, as estimated from the joints,
decides what is best, what is rolled back and when to stop. Checks take robot time like any trial.
All randomness follows from seed and number of the trial, so that a run that was killed goes on
exactly: networks and optimisers from a checkpoint, experience from the trials' traces.
"""

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.controllers import command_schedule, hardware_trial, protocol
from hopping_leg.controllers.policy import Policy
from hopping_leg.envs import apex_reward
from hopping_leg.errors import UsageError
from hopping_leg.io import write_atomically, write_json
from hopping_leg.locks import hold_folder
from hopping_leg.rl import checkpoint, onnx_export, run_folder
from hopping_leg.rl.finetune import command_correction, config, learner, replay
from hopping_leg.rl.finetune.apex_estimate import prepare
from hopping_leg.rl.finetune.trial_data import Score, TrialData, estimated, score, settled
from hopping_leg.trace import Trace

RESULT = "finetune.json"
POLICY = "policy.onnx"

Row = dict[str, Any]
"""Result of a trial, as JSON values."""


class Finetuning:
    """One continued training, see ``finetune``."""

    def __init__(
        self,
        task: config.Task,
        robot: hardware_trial.TrialRobot,
        options: config.FinetuneConfig,
        folder: Path,
        pretraining: Path | None = None,
        on_trial: Callable[[Row], None] = lambda _: None,
    ) -> None:
        self._task, self._robot, self._options, self._folder = task, robot, options, folder
        self._on_trial = on_trial
        self._estimator = prepare(
            task.policy, task.robot, options.contact, pretraining or folder / "pretraining"
        )
        self._network = onnx_export.read_network(task.policy.content)
        self._correction = command_correction.LinearCommandCorrection(*task.commands)
        self._learner: learner.Learner | None = None
        self._best = self._origin = (self._network, self._correction)
        self._explored = 0
        self.rows: list[Row] = []

    def run(self) -> tuple[bytes, str]:
        """Go on until a rule ends it; return the best policy's file and why it ended."""
        self._restore()
        while not (reason := self._reason()):
            check = self._check_is_due()
            number = len(self.rows)
            schedule = self._schedule(number, check=check)
            controller = self._controller(number, check=check)
            trial = self._robot.hop(controller, schedule, self._seed(number, 0))
            trial.trace.save(self._trace(number))
            self._evaluate(trial, schedule, check=check)
            self._checkpoint()
            self._on_trial(self.rows[-1])
        return self._content(*self._best), reason

    @property
    def minutes(self) -> float:
        """Robot time so far."""
        return float(self.rows[-1]["minutes"]) if self.rows else 0.0

    @property
    def _errors(self) -> list[float]:
        return [row["error_m"] for row in self.rows if row["kind"] == "check"]

    def _errors_since(self) -> list[float]:
        """Return the best error and those of the checks since a policy was rolled back, m."""
        checks = [row for row in self.rows if row["kind"] == "check"]
        rolled_back = [index for index, row in enumerate(checks) if row["rolled_back"]]
        first = rolled_back[-1] + 1 if rolled_back else 0
        return [min(self._errors), *(row["error_m"] for row in checks[first:])]

    def _reason(self) -> str:
        o = self._options
        return o.stopping_rules.reason(self._errors, self.minutes, o.trial_seconds / 60)

    def _learns_weights(self) -> bool:
        method, first = self._options.method, self._options.correction_minutes
        return method == "sac" or (method == "both" and self.minutes >= first)

    def _check_is_due(self) -> bool:
        latest = [row["kind"] for row in self.rows[-self._options.explorations :]]
        return not self._learns_weights() or "check" not in latest

    def _schedule(self, number: int, *, check: bool) -> command_schedule.CommandSchedule:
        o, rng = self._options, np.random.default_rng((self._task.seed, number, 1))
        if check:
            each = o.trial_seconds / len(o.commands)
            return command_schedule.CommandSchedule(
                tuple((command, each) for command in o.commands)
            )
        sampled = rng.uniform(*self._task.commands, round(o.trial_seconds / o.hold))
        return command_schedule.CommandSchedule(
            tuple((float(command), o.hold) for command in sampled)
        )

    def _controller(self, number: int, *, check: bool) -> protocol.Controller:
        content = self._content(self._network, self._correction)
        if check:
            return Policy(content, "the policy in training", self._task.policy.name)
        assert self._learner is not None
        rng = np.random.default_rng((self._task.seed, number, 2))
        card = self._task.policy.card
        return replay.ExploringPolicy(
            content, card, self._learner.spread, self._options.sde_sample_freq, rng
        )

    def _evaluate(
        self,
        trial: hardware_trial.HardwareTrial,
        schedule: command_schedule.CommandSchedule,
        *,
        check: bool,
    ) -> None:
        """Score and record a trial, and learn from it."""
        data = TrialData.of([trial.trace])
        estimate = self._estimator(data)
        apexes = estimated(trial, estimate)
        judged = score(apexes, schedule, trial.complaint)
        row: Row = {
            "outing": len(self.rows),
            "kind": "check" if check else "exploration",
            "minutes": self.minutes + trial.seconds / 60,
            "complaint": trial.complaint,
            "aim_m": list(self._correction.shift),
            **_numbers(judged, ""),
        }
        if trial.truth is not None:
            row |= _numbers(score(trial.truth, schedule, trial.complaint), "true_")
        row["rolled_back"] = False
        self.rows.append(row)
        if check or trial.complaint:
            self._keep_best_or_roll_back(row)
        if self._learns_weights():
            self._learn(trial, len(data.command), explored=not check)
        elif not row["rolled_back"]:
            counted = settled(apexes, schedule)
            errors, options = counted[:, 2] - counted[:, 1], self._options.correction
            self._correction = self._correction.updated(counted[:, 1], errors, options)

    def _keep_best_or_roll_back(self, row: Row) -> None:
        check = row["kind"] == "check"
        if check and row["error_m"] <= min(self._errors):
            self._best = (self._network, self._correction)
        elif row["complaint"] or self._options.stopping_rules.rolled_back(self._errors_since()):
            row["rolled_back"] = True
            self._network, self._correction = self._best
            if self._learner is not None:
                self._learner.set_actor(self._network)

    def _learn(self, trial: hardware_trial.HardwareTrial, ticks: int, *, explored: bool) -> None:
        if self._learner is None:
            self._network, self._correction = self._best
            taught = self._begin_learning()
            taught.learn(self._options.first_steps, self._seed(0, 5), critics_only=True)
        else:
            taught = self._learner
            self._keep(taught, trial.trace, bool(trial.complaint))
        self._explored += explored
        steps = round(self._options.steps_per_tick * ticks)
        first = self._explored <= self._options.critics_first
        taught.learn(steps, self._seed(len(self.rows), 3), critics_only=first)
        self._network = taught.network()

    def _keep(self, taught: learner.Learner, trace: Trace, ended: bool) -> None:
        data = TrialData.of([trace])
        taught.keep(self._writer()(data, self._estimator(data), ended=ended))

    def _begin_learning(self) -> learner.Learner:
        """Make a learner that knows the believed robot and every trial so far."""
        o, task = self._options, self._task
        self._origin = (self._network, self._correction)
        hidden = len(self._network.layers[-1][0][0])
        spread = np.full((hidden, 2), np.exp(o.learner.log_std))
        rng = np.random.default_rng((task.seed, 4))
        content = self._content(self._network, self._correction)
        explorer = replay.ExploringPolicy(content, task.policy.card, spread, o.sde_sample_freq, rng)
        rows = replay.believed_rows(
            task.robot, task.commands, task.seed,
            explorer, self._estimator, self._writer(), o.believed_seconds,
        )  # fmt: skip
        self._learner = taught = learner.Learner(self._network, rows, o.learner, task.seed)
        for row in self.rows:
            self._keep(taught, Trace.load(self._trace(row["outing"])), bool(row["complaint"]))
        return taught

    def _writer(self) -> replay.TransitionWriter:
        o, card = self._options, self._task.policy.card
        reward = apex_reward(self._task.robot, o.reward, card.rate)
        reward.anneal(1.0)
        scaled = self._correction.applied(self._network, card)
        return replay.TransitionWriter(card, scaled, self._task.robot, reward, o.penalty)

    def _content(
        self, network: onnx_export.Network, correction: command_correction.LinearCommandCorrection
    ) -> bytes:
        policy = self._task.policy
        card = replace(
            policy.card,
            recipe=f"{policy.card.recipe}, continued from {policy.digest}",
            seed=self._task.seed,
            steps=policy.card.steps + round(60 * self.minutes * policy.card.rate),
        )
        return onnx_export.build_policy(correction.applied(network, card), card)

    def _seed(self, number: int, purpose: int) -> int:
        sequence = np.random.SeedSequence((self._task.seed, number, purpose))
        return int(sequence.generate_state(1)[0])

    def _trace(self, number: int) -> Path:
        return self._folder / "outings" / f"{number:04d}.parquet"

    def _checkpoint(self) -> None:
        tree: checkpoint.Tree = {
            "rows": self.rows,
            "explored": self._explored,
            "now": _as_tree(self._network, self._correction),
            "best": _as_tree(*self._best),
            "origin": _as_tree(*self._origin),
            "learner": None if self._learner is None else self._learner.state(),
        }
        checkpoint.write_checkpoint(self._folder / "checkpoints", len(self.rows), tree)

    def _restore(self) -> None:
        """Go on from the newest checkpoint, if there is one."""
        found = checkpoint.list_checkpoints(self._folder / "checkpoints")
        if not found:
            return
        tree = checkpoint.read_checkpoint(found[-1])
        self.rows, self._explored = tree["rows"], tree["explored"]
        if tree["learner"] is not None:
            self._network, self._correction = self._from_tree(tree["origin"])
            self._begin_learning().restore(tree["learner"])
        self._network, self._correction = self._from_tree(tree["now"])
        self._best = self._from_tree(tree["best"])

    def _from_tree(
        self, tree: checkpoint.Tree
    ) -> tuple[onnx_export.Network, command_correction.LinearCommandCorrection]:
        layers = [(np.array(weight), np.array(bias)) for weight, bias in tree["layers"]]
        a, b = tree["shift"]
        return replace(self._network, layers=layers), replace(self._correction, shift=(a, b))


def _as_tree(
    network: onnx_export.Network, correction: command_correction.LinearCommandCorrection
) -> checkpoint.Tree:
    return {"layers": [list(layer) for layer in network.layers], "shift": list(correction.shift)}


def _numbers(judged: Score, prefix: str) -> Row:
    return {
        f"{prefix}error_m": judged.error,
        f"{prefix}hops": judged.hops,
        f"{prefix}by_command": [
            {"command_m": c, "median_abs_error_m": error, "median_error_m": judged.offsets[c]}
            for c, error in judged.by_command.items()
        ],
    }


def finetune(
    task: config.Task,
    robot: hardware_trial.TrialRobot,
    options: config.FinetuneConfig,
    out: Path,
    *,
    resume: bool = False,
    pretraining: Path | None = None,
    on_trial: Callable[[Row], None] = lambda _: None,
) -> dict[str, Any]:
    """Continue a policy's training and leave policy, card and numbers in a folder.

    ``pretraining`` is the folder of what is learnt beforehand, if others share it. Returns the
    content of ``finetune.json``; raises ``UsageError`` where ``out`` holds a run that cannot be
    continued so.
    """
    asked = run_folder.as_stored(
        {
            "policy": task.policy.name,
            "policy_digest": task.policy.digest,
            "robot": task.robot.name,
            "robot_digest": task.robot.digest,
            "on": robot.name,
            "seed": task.seed,
            "options": asdict(options),
        }
    )
    with hold_folder(out, UsageError):
        if run_folder.is_new(out, resume=resume):
            write_json(out / "config.json", asked)
        else:
            run_folder.check_same(out, run_folder.read_json(out / "config.json"), asked)
            run_folder.refuse_finished(out / POLICY)
        finetuning = Finetuning(task, robot, options, out, pretraining, on_trial)
        content, reason = finetuning.run()
        result = {
            **asked,
            **summary(finetuning.rows, reason),
            "versions": run_folder.library_versions(),
        }
        write_json(out / RESULT, result)
        write_atomically(out / "model_card.md", card(result).encode())
        write_atomically(out / POLICY, content)
        return result


def summary(rows: list[Row], reason: str) -> dict[str, Any]:
    """Return what a finished run comes to, as JSON values."""
    checks = [row for row in rows if row["kind"] == "check"]
    best = min(checks, key=lambda row: float(row["error_m"])) if checks else None
    return {
        "why_it_ended": reason,
        "minutes": rows[-1]["minutes"] if rows else 0.0,
        "best_check": best,
        "first_check": checks[0] if checks else None,
        "safety": {
            "ended_early": sum(bool(row["complaint"]) for row in rows),
            "complaints": sorted({row["complaint"] for row in rows if row["complaint"]}),
            "rolled_back": sum(row["rolled_back"] for row in rows),
        },
        "outings": rows,
    }


def card(result: dict[str, Any]) -> str:
    """Return the model card of a finished run, as Markdown, from its ``finetune.json``."""
    best, first = result["best_check"], result["first_check"]
    lines = [
        f"# Policy `{result['policy']}`, continued on `{result['on']}`\n",
        f"Source: policy `{result['policy']}` ({result['policy_digest']}), believed robot"
        f" `{result['robot']}` ({result['robot_digest']}), seed {result['seed']}, method"
        f" `{result['options']['method']}`.\n",
        f"- Robot time: {result['minutes']:.1f} min in {len(result['outings'])} trials."
        f" {result['why_it_ended']}",
        f"- Ended early: {result['safety']['ended_early']}; rolled back:"
        f" {result['safety']['rolled_back']}.",
    ]
    if best:
        lines.append(
            f"- Median |apex - command| as estimated from the joints: {1e3 * first['error_m']:.1f}"
            f" mm on the first check, {1e3 * best['error_m']:.1f} mm on the best, which chose it."
        )
    return "\n".join(lines) + "\n"
