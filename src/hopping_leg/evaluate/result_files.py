"""Results on the disk: runs of `hop evaluate` and `hop train`, and what a killed benchmark kept."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from hopping_leg.errors import UsageError
from hopping_leg.evaluate.result import SCHEMA, Evaluation
from hopping_leg.io import parse_json, write_json

_EVALUATION, _TRAINING = "evaluation.json", "result.json"
_WHAT = (
    "name a folder or JSON file of `hop evaluate` (the paper's suite) or a folder of `hop train`"
)


@dataclass(frozen=True)
class StoredRun:
    """One run to be compared."""

    label: str
    """Name in all tables and figures."""
    path: Path
    """As it was named."""
    evaluation: Evaluation | None = None
    """What `hop evaluate` measured."""
    training: dict[str, Any] | None = None
    """``result.json`` of a training."""
    traces: Path | None = None
    """Folder of the evaluation's traces, if it was kept."""


def read_runs(names: Sequence[str]) -> list[StoredRun]:
    """Read runs, named by what of their paths tells them apart, or by LABEL of LABEL=PATH.

    Raises:
        UsageError: A path is no run, or two have the same name.
    """
    asked = [_split(name) for name in names]
    paths = [path for _, path in asked]
    shortest = _labels(paths)
    labels = [label or short for (label, _), short in zip(asked, shortest, strict=True)]
    for label in labels:
        if labels.count(label) > 1:
            raise UsageError(f"Two runs are called '{label}'; tell them apart with LABEL=PATH.")
    return [_read(label, path) for label, path in zip(labels, paths, strict=True)]


def _split(name: str) -> tuple[str, Path]:
    label, equals, path = name.partition("=")
    named = equals and not Path(name).exists()
    return (label, Path(path)) if named else ("", Path(name))


def _labels(paths: Sequence[Path]) -> list[str]:
    """Return the last parts of each path, as many as it takes to tell all apart."""
    whole = [
        p.parent if p.name in (_EVALUATION, _TRAINING) else p for p in map(Path.resolve, paths)
    ]
    parts = [p.with_suffix("").parts if p.suffix == ".json" else p.parts for p in whole]
    labels: list[str] = []
    for depth in range(1, max(map(len, parts), default=1) + 1):
        labels = ["/".join(p[-depth:]) for p in parts]
        if len(set(labels)) == len(labels):
            break
    return labels


def _read(label: str, path: Path) -> StoredRun:
    if not path.exists():
        raise UsageError(f"There is no {path}; {_WHAT}.")
    if not path.is_dir():
        content = _load(path)
        if "history" in content and "recipe" in content:
            return StoredRun(label, path, training=content)
        return StoredRun(label, path, evaluation=_evaluation(content, path))
    evaluation, training, traces = path / _EVALUATION, path / _TRAINING, path / "traces"
    measured = _evaluation(_load(evaluation), evaluation) if evaluation.exists() else None
    trained = _load(training) if training.exists() else None
    if trained is not None and "history" not in trained:
        raise UsageError(f"{training} is not of a training; {_WHAT}.")
    if measured is None and trained is None:
        if (path / "config.json").exists():
            raise UsageError(
                f"The training in {path} is not finished; repeat the command that began it, with"
                " --resume."
            )
        raise UsageError(f"{path} is not a run: it holds neither {_EVALUATION} nor {_TRAINING}.")
    kept = traces if measured and traces.is_dir() else None
    return StoredRun(label, path, measured, trained, kept)


def _load(path: Path) -> dict[str, Any]:
    try:
        return parse_json(path.read_bytes(), str(path))
    except UsageError as error:
        raise UsageError(f"{error} For a run, {_WHAT}.") from error


def _evaluation(content: dict[str, Any], path: Path) -> Evaluation:
    if "summary" not in content or "distributions" not in content:
        raise UsageError(f"{path} is not an evaluation by the paper's trials; {_WHAT}.")
    if content.get("schema") != SCHEMA:
        raise UsageError(
            f"{path} has schema {content.get('schema')} but this version reads {SCHEMA};"
            " evaluate again."
        )
    try:
        return evaluation_from(content)
    except (TypeError, KeyError, AttributeError) as error:
        raise UsageError(f"{path} is damaged or of another version; evaluate again.") from error


def evaluation_from(content: dict[str, Any]) -> Evaluation:
    """Return the evaluation that ``Evaluation.to_json`` wrote; numbers that are null are NaN."""
    secondary = content["secondary"]
    fields = {k: v for k, v in content.items() if k not in ("schema", "secondary")}
    fields["secondary"] = secondary and evaluation_from(secondary)
    evaluation: Evaluation = _filled(Evaluation, fields)
    _filled(list[_Apexes], evaluation.distributions)
    _ = [evaluation.conditions[name] for name in ("robot", "floor", "seeds", "seed")]
    return evaluation


@dataclass(frozen=True)
class _Apexes:
    """An entry of an evaluation's distributions."""

    controller: str
    command_m: float
    apexes_m: list[float] = field(default_factory=list)


def _filled(kind: Any, value: Any) -> Any:  # noqa: ANN401
    """Return a value of JSON as a type, dataclasses in lists included."""
    if is_dataclass(kind) and isinstance(value, dict):
        hints = get_type_hints(kind)
        return kind(**{name: _filled(hints[name], entry) for name, entry in value.items()})  # type: ignore[operator]
    if isinstance(kind, UnionType):
        return value if value is None else _filled(get_args(kind)[0], value)
    plain = get_origin(kind) or kind
    if kind is float:
        plain, value = (int, float), float("nan") if value is None else value
    if not isinstance(value, plain):
        raise TypeError(f"{value!r} is no {kind}")
    if plain is list and get_args(kind):
        return [_filled(get_args(kind)[0], entry) for entry in value]
    return value


@dataclass(frozen=True)
class ResultCache:
    """Runs work once: its result lies in a folder and is taken from there the next time."""

    folder: Path
    on_begin: Callable[[str], None] = lambda words: None
    """Told, in words, what begins."""

    def load_or_run(
        self, name: str, words: str, asked: dict[str, Any], work: Callable[[], dict[str, Any]]
    ) -> dict[str, Any]:
        """Return the kept result of the same work, or do it and keep its result.

        ``asked`` is all that the result depends on; it and the result are JSON values.
        """
        file = self.folder / f"{name}.json"
        asked = json.loads(json.dumps(asked))
        if file.exists():
            kept: dict[str, Any] = json.loads(file.read_bytes())
            if kept["asked"] == asked:
                return dict(kept["result"])
        self._begin(name, asked)
        self.on_begin(words)
        result = work()
        write_json(file, {"asked": asked, "result": result})
        return dict(json.loads(file.read_bytes())["result"])

    def _begin(self, name: str, asked: dict[str, Any]) -> None:
        """Prepare for work that is not kept yet."""
