"""The command line `hop`: one small module per verb.

A verb's module has a docstring, which is its help, and a function ``run(args)``. The annotation of
``args`` is a frozen dataclass of options (or a union of dataclasses, which become subcommands);
the docstring under each field is that option's help, shown by tyro. Modules are imported only when
their verb is called, so that ``hop --help`` is instant and nothing but training loads torch.
"""

import contextlib
import errno
import importlib
import inspect
import io
import itertools
import os
import re
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from typing import Any, get_type_hints

import tyro

from hopping_leg.errors import HoppingLegError, UsageError, unknown_name

VERBS = {
    "demo": "watch learned beside classical control in the browser, at once",
    "robots": "list the legs, show every number, import or check your own",
    "evaluate": "run the paper's trials for controllers and write the report",
    "train": "train a controller from scratch, or go on after an interruption",
    "record": "write an excitation, play it on a leg and record it",
    "identify": "fit a leg to recordings and write its robot file",
    "deploy": "run a controller on the real leg, or on emulated drives",
    "emulate": "stand in for the real leg: two drives behind a real wire",
    "doctor": "say what is missing here; check, configure and home a leg's drives",
    "view": "watch the leg in the browser: live, a trace, or the real one",
    "report": "draw what stored traces show",
    "export": "write a leg as URDF, a policy as ONNX, traces as MCAP",
    "reproduce": "the main job: record, identify, train, hop, evaluate, report",
}
"""Every verb with its line in the overview."""

_CONFIG = (tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes)
_LIST = re.compile(r"[\w.+-]+(,[\w.+-]+)+")

FAILED = 2
INTERRUPTED = 130
TERMINATED = 143


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, by default the process's own; return the exit code."""
    for stream in (sys.stdout, sys.stderr):  # replace what their encoding does not know
        with contextlib.suppress(AttributeError, ValueError, io.UnsupportedOperation):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    with _interrupted_by_sigterm():
        return guard(lambda: _dispatch(list(sys.argv[1:] if arguments is None else arguments)))


class _Terminated(KeyboardInterrupt):
    """SIGTERM came."""


@contextlib.contextmanager
def _interrupted_by_sigterm() -> Iterator[None]:
    """Let SIGTERM end a verb as Ctrl-C does, with what it says of how to go on."""

    def end(*_: object) -> None:
        raise _Terminated

    default = signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    if not default or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def guard(program: Callable[[], int]) -> int:
    """Return a program's exit code; what a user can mend is said in a sentence on stderr."""
    code = FAILED
    try:
        return program()
    except HoppingLegError as error:
        sentence = str(error)
    except KeyboardInterrupt as stop:
        sentence = "Interrupted; finished files are whole and nothing was half-written."
        code = TERMINATED if isinstance(stop, _Terminated) else INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        return FAILED
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        sentence = f"Could not use{where or ' a file'}: {error.strerror or error}."
        if error.errno == errno.ENOSPC:
            sentence = f"The disk is full; could not write{where}. Free some space and try again."
    except ModuleNotFoundError as error:
        extra = _EXTRAS.get((error.name or "").split(".")[0])
        if extra is None:
            raise
        sentence = (
            f"This needs {error.name}, which comes with the extra '{extra}':"
            f" pip install 'hopping-leg[{extra}]'."
        )
    except Exception as error:
        name = _refused_variable(error)
        if name is None:
            raise
        sentence = f"'{os.environ[name]}' in the variable {name} does not work here; unset it."
    with contextlib.suppress(OSError, ValueError):  # the terminal may be gone
        print(f"hop: {sentence}", file=sys.stderr)
    return code


def _refused_variable(error: Exception) -> str | None:
    """Return the variable that ended the import of MuJoCo or matplotlib, if it was one."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    imported = [f.f_globals["__name__"] for f in frames if f.f_code.co_name == "<module>"]
    for name, module in (
        ("MUJOCO_GL", "mujoco.rendering.classic.gl_context"),
        ("MPLBACKEND", "matplotlib"),
    ):
        if module in imported and name in os.environ:
            return name
    return None


_EXTRAS = {
    **dict.fromkeys(("torch", "stable_baselines3", "onnx", "tensorboard"), "train"),
    **dict.fromkeys(("moteus", "can", "serial"), "hardware"),
    **dict.fromkeys(("mcap", "mcap_ros2", "rosbags"), "ros"),
    "viser": "view",
    "playwright": "dev",
}


def _dispatch(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print(overview())
        return 0
    verb, rest = words[0], words[1:]
    if verb in ("--version", "-V", "version"):
        print(f"hop {version('hopping-leg')}")
        return 0
    if verb not in VERBS:
        raise UsageError(unknown_name("verb", verb, VERBS) + " Try `hop --help`.")
    from hopping_leg.terminal import said_if_slow

    with said_if_slow(f"Loading hop {verb}."):
        module = importlib.import_module(f"hopping_leg.cli.{verb}")
        from hopping_leg.cli.options import check_outputs

    kind = get_type_hints(module.run, include_extras=True)["args"]
    args = read_options(kind, f"hop {verb}", inspect.getdoc(module), rest)
    check_outputs(args)
    module.run(args)
    return 0


def read_options(
    options: Any,  # noqa: ANN401
    program: str,
    description: str | None,
    words: Sequence[str],
) -> Any:  # noqa: ANN401
    """Return an instance of a dataclass of options, or of one of a union's, as subcommands.

    Lists may be given with commas or spaces.

    Raises:
        UsageError: The words are not as the options ask.
        SystemExit: Help was asked for, and is printed.
    """
    apart = [part for word in words for part in _parts(word)]
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(
                options, prog=program, description=description, args=apart, config=_CONFIG
            )
    except SystemExit as ended:
        if not ended.code:
            raise
        raise UsageError(f"{_sentence(said.getvalue())} `{program} --help` shows more.") from ended


def _parts(word: str) -> list[str]:
    return word.split(",") if _LIST.fullmatch(word) and not os.path.exists(word) else [word]  # noqa: PTH110


def _sentence(box: str) -> str:
    """Return what is wrong from the box that tyro prints: what stands above its inner line."""
    inside = [line.strip("\u2502| ") for line in box.splitlines()[1:]]
    begun = itertools.dropwhile(lambda line: not line.strip("\u2500-"), inside)
    above = itertools.takewhile(lambda line: line.strip("\u2500-\u2570\u256f"), begun)
    text = " ".join(line for line in above if line)
    near = re.search(r"Perhaps you meant:\s*(--[\w-]+)", "\n".join(inside))
    text = text if text.endswith((".", "!", "?")) else f"{text}."
    return f"{text} Did you mean {near[1]}?" if near else text


def overview() -> str:
    """Return what ``hop --help`` prints."""
    verbs = "\n".join(f"  {verb:<10}  {line}" for verb, line in VERBS.items())
    return (
        "A one-legged robot hops to commanded heights: simulate, train, evaluate, deploy.\n\n"
        f"{verbs}\n\n`hop VERB --help` explains a verb, `hop --version` says which version this is."
    )
