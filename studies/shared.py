"""What studies share: options, errors in a sentence, the results that they store, timing.

A study's ``RESULTS`` are the shell commands behind ``studies/NAME/results`` and ``figures``;
``python -m studies.NAME --results`` runs them and renders the pages that show them.
Timings alternate what is compared and take medians, so that other load cannot bias them.
"""

import importlib
import inspect
import json
import os
import platform
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.cli import COMMAND, guard, read_options
from hopping_leg.cli.options import save_json, show_table
from hopping_leg.errors import UsageError
from hopping_leg.io import versions, write_atomically, write_json
from hopping_leg.sim import compile_physics
from hopping_leg.workers import ProcessWorkers

Row = dict[str, Any]
"""JSON values by name: a result, or a record of it."""

ROOT = Path(__file__).parent.parent

LONGEST = 30  # Numbers of a list in a stored result; what is longer is raw
IF_SHOWN = ("groups", "ladder", "neighbours", "sequence")  # Of an evaluation, where a page has it


def main(
    name: str,
    options: Any = None,  # noqa: ANN401
    arguments: Sequence[str] | None = None,
) -> int:
    """Run a study, print its numbers, write the JSON; return the exit code.

    Args:
        name: Name of the study, as in ``python -m studies.NAME``.
        options: Its options: a dataclass with a field ``json`` and a method ``measure``, or a union
            of such dataclasses, one for each part; None for a study that is only its results.
        arguments: Words behind the name; default: those of the process.
    """
    given = sys.argv[1:] if arguments is None else arguments
    if options is None or list(given) == ["--results"]:
        return guard(lambda: run_results(name))
    return guard(lambda: _run(name, options, given))


def _run(name: str, options: Any, given: Sequence[str]) -> int:  # noqa: ANN401
    program = f"python -m studies.{name}"
    COMMAND.set(shlex.join([*program.split(), *given]))
    about = inspect.getdoc(importlib.import_module(f"studies.{name}"))
    args = read_options(options, program, about, given)
    result = {"command": COMMAND.get(), **args.measure()}
    save_json(args.json, result)
    if args.json is not None:
        print(f"Wrote {args.json}.")
    return 0


def results(name: str) -> tuple[str, ...]:
    """Return the commands behind a study's stored results."""
    commands: tuple[str, ...] = importlib.import_module(f"studies.{name}").RESULTS
    return commands


def stored_file(command: str) -> Path | None:
    """Return the file that a command's ``--json`` names, from the root; None without one."""
    words = shlex.split(command)
    return Path(words[words.index("--json") + 1]) if "--json" in words else None


def run_results(name: str) -> int:
    """Run the commands behind a study's stored results, one after the other."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    for command in results(name):
        print(command, flush=True)
        done = subprocess.run(command, shell=True, cwd=ROOT, env={**os.environ, "PATH": path})
        if done.returncode:
            raise UsageError(f"`{command}` failed with exit code {done.returncode}; see above.")
        if file := stored_file(command):
            store(ROOT / file, command)
    subprocess.run([sys.executable, ROOT / "docs/render.py"], check=True)
    return 0


def store(file: Path, command: str) -> None:
    """Rewrite a result as it is stored: with its command, without raw numbers, a line a record.

    ``pairs`` are stored without the names of their entries, which ``columns`` has once, and the
    lists of ``IF_SHOWN`` where a page shows them.
    """
    content = json.loads(file.read_text(encoding="utf-8"))
    if isinstance(content.get("trials"), list) and len(content["trials"]) > 2 * LONGEST:
        del content["trials"]
    if pairs := content.get("pairs"):
        rows = [list(pair.values()) for pair in pairs]
        content["pairs"] = {"columns": list(pairs[0]), "rows": rows}
    pages = (*ROOT.glob("docs/*.md"), *ROOT.glob("studies/*/README.md"))
    shown = "".join(page.read_text(encoding="utf-8") for page in pages)
    for key in IF_SHOWN:
        if f'{file.parents[1].name}/{file.name}", "{key}' not in shown:
            content.pop(key, None)
    content = condensed({**content, "command": command})
    write_atomically(file, f"{_lines(content)}\n".encode())


def condensed(tree: Any) -> Any:  # noqa: ANN401
    """Return JSON values without long lists of numbers, and numbers to five digits."""
    if isinstance(tree, dict):
        return {key: condensed(entry) for key, entry in tree.items() if not _raw(entry)}
    if isinstance(tree, list):
        return [condensed(entry) for entry in tree]
    return float(f"{tree:.5g}") if isinstance(tree, float) else tree


def _raw(entry: object) -> bool:
    numbers = isinstance(entry, list) and not any(isinstance(x, dict | list | str) for x in entry)
    return numbers and isinstance(entry, list) and len(entry) > LONGEST


def _lines(tree: Any, indent: str = "") -> str:  # noqa: ANN401
    """Return JSON in which what holds no records stands on one line."""
    inner = f"{indent} "
    if isinstance(tree, dict) and any(isinstance(entry, dict | list) for entry in tree.values()):
        parts = [f"{json.dumps(key)}: {_lines(entry, inner)}" for key, entry in tree.items()]
    elif isinstance(tree, list) and any(isinstance(entry, dict | list) for entry in tree):
        parts = [_lines(entry, inner) for entry in tree]
    else:
        return json.dumps(tree, ensure_ascii=False)
    left, right = "{}" if isinstance(tree, dict) else "[]"
    return f"{left}\n" + ",\n".join(f"{inner}{part}" for part in parts) + f"\n{indent}{right}"


def recordings_folder(named: Path | None) -> Path:
    """Return the folder of real recordings, or raise UsageError if none is named."""
    folder = named or os.environ.get("HOPPING_LEG_RECORDINGS")
    if not folder:
        raise UsageError(
            "Name the folder of recordings with --recordings, or in HOPPING_LEG_RECORDINGS."
        )
    return Path(folder)


def once(file: Path, asked: Row, work: Callable[..., Row], *arguments: object) -> Row:
    """Return what a file keeps of the same work, or do it and keep its result there.

    Args:
        file: JSON file.
        asked: All that the result depends on, as JSON values.
        work: Returns the result, JSON values too.
        arguments: Of the work.
    """
    asked = json.loads(json.dumps(asked))
    kept = json.loads(file.read_bytes()) if file.exists() else {}
    if kept.get("asked") != asked:
        print(f"{file.stem} ...", flush=True)
        kept = {"asked": asked, "result": work(*arguments)}
        write_json(file, kept)
        kept = json.loads(file.read_bytes())
    result: Row = kept["result"]
    return result


def do_all(jobs: Iterable[tuple[Any, ...]], at_once: int = 1) -> list[Row]:
    """Return the results of jobs, each the arguments of ``once``, in processes if several."""
    compile_physics()  # once, before the processes
    with ProcessWorkers(at_once) as workers:
        return list(workers.map(once, jobs))


def show_rows(rows: Iterable[Row], *names: str) -> None:
    """Print columns of rows by their names."""
    columns = [name.replace("_", " ") for name in names]
    show_table(columns, ([_shown(row[name]) for name in names] for row in rows))


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return "–" if value is None else str(value)


def show_numbers(title: str, numbers: Row) -> None:
    """Print the numbers of a result, those of its parts under dotted names."""
    show_table(("number", "value"), ((k, f"{v:.4g}") for k, v in _numbers(numbers)), title)


def _numbers(tree: Row, start: str = "") -> Iterator[tuple[str, float]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _numbers(value, f"{start}{name}.")
        elif isinstance(value, int | float):
            yield f"{start}{name}", value


Timed = Callable[[], object]


def seconds(function: Timed) -> float:
    """Return how long one call takes, s."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def interleave(functions: Mapping[str, Timed], repeats: int) -> dict[str, Array]:
    """Return the seconds of functions that are timed in turn, by name, (repeats,).

    The first, cold round is not in it.
    """
    rounds = [{name: seconds(work) for name, work in functions.items()} for _ in range(repeats + 1)]
    return {name: np.array([taken[name] for taken in rounds[1:]]) for name in functions}


def host() -> Row:
    """Return what a timing depends on: processor, load, versions."""
    return {
        "cores": os.cpu_count(),
        "machine": platform.machine(),
        "load_average": os.getloadavg()[0],
        **versions("mujoco", "numpy", "gymnasium"),
    }
