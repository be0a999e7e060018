"""The command line `hop`: one small module per verb.

A verb's module has a docstring, which is its help, and a function ``run(args)``. The annotation of
``args`` is a frozen dataclass of options (or a union of dataclasses, which become subcommands);
the docstring under each field is that option's help, shown by tyro. Modules are imported only when
their verb is called, so that ``hop --help`` is instant and nothing but training loads torch.
"""

import contextlib
import importlib
import inspect
import io
import os
import re
import shlex
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from importlib.metadata import version
from typing import Any, get_type_hints

import tyro

from hopping_leg.errors import HoppingLegError, UsageError, unknown_name

VERBS = {
    "demo": "watch learned beside classical control in the browser",
    "robots": "list the legs, show every number, import or check your own",
    "evaluate": "run the paper's trials for controllers and write the report",
    "train": "train a controller from scratch, or go on after an interruption",
    "record": "write an excitation, play it on a leg and record it",
    "identify": "fit a leg to recordings and write its robot file",
    "deploy": "run a controller on the real leg, or on emulated drives",
    "emulate": "stand in for the real leg: two drives behind a real wire",
    "doctor": "check, configure and home a leg's drives; compile what is compiled",
    "view": "watch the leg in the browser: live, or a trace",
    "report": "draw what stored traces show",
    "export": "write a leg as URDF, a policy as ONNX, traces as MCAP",
    "reproduce": "the main job: record, identify, train, hop, evaluate, report",
}
"""Every verb with its line in the overview."""

DEMO = ("universal", "energy-shaping")
"""What `hop demo`, `hop view` and the live page show first: learned beside classical control."""

COMMAND = ContextVar("COMMAND", default="hop")
"""The command that runs, as the shell reads it, for what is stored."""

_CONFIG = (tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes)
_LIST = re.compile(r"[\w.+-]+(,[\w.+-]+)+")

FAILED = 2
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line, by default the process's own; return the exit code."""
    for stream in (sys.stdout, sys.stderr):  # replace what their encoding does not know
        with contextlib.suppress(AttributeError, ValueError, io.UnsupportedOperation):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C does
    return guard(lambda: _dispatch(list(sys.argv[1:] if arguments is None else arguments)))


def guard(program: Callable[[], int]) -> int:
    """Return a program's exit code; what a user can mend is said in a sentence on stderr."""
    code = FAILED
    try:
        return program()
    except HoppingLegError as error:
        sentence = str(error)
    except KeyboardInterrupt:
        sentence = "Interrupted; finished files are whole and nothing was half-written."
        code = INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        return FAILED
    except OSError as error:
        sentence = f"Could not use {error.filename or 'a file'}: {error.strerror or error}."
    except ModuleNotFoundError as error:
        extra = _EXTRAS.get((error.name or "").split(".")[0])
        if extra is None:
            raise
        sentence = (
            f"This needs {error.name}, which comes with the extra '{extra}':"
            f" pip install 'hopping-leg[{extra}]'."
        )
    with contextlib.suppress(OSError, ValueError):  # the terminal may be gone
        print(f"hop: {sentence}", file=sys.stderr)
    return code


_EXTRAS = {
    **dict.fromkeys(("torch", "stable_baselines3", "onnx", "tensorboard"), "train"),
    **dict.fromkeys(("moteus", "can", "serial"), "hardware"),
    **dict.fromkeys(("mcap", "mcap_ros2", "rosbags"), "ros"),
    **{"viser": "view", "moteus_pi3hat": "pi3hat"},
}


def _dispatch(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print("A one-legged robot hops to commanded heights: simulate, train, evaluate, deploy.\n")
        print("\n".join(f"  {verb:<10}  {line}" for verb, line in VERBS.items()))
        print("\n`hop VERB --help` explains a verb, `hop --version` says which version this is.")
        return 0
    verb, rest = words[0], words[1:]
    if verb in ("--version", "-V", "version"):
        print(f"hop {version('hopping-leg')}")
        return 0
    if verb not in VERBS:
        raise UsageError(unknown_name("verb", verb, VERBS) + " Try `hop --help`.")
    COMMAND.set(shlex.join(["hop", *words]))
    try:
        module = importlib.import_module(f"hopping_leg.cli.{'view' if verb == 'demo' else verb}")
    except (AttributeError, RuntimeError) as error:  # where MuJoCo imports OpenGL
        if "mujoco" in sys.modules or (drawing := os.environ.get("MUJOCO_GL")) is None:
            raise
        raise UsageError(
            f"MuJoCo finds no library for MUJOCO_GL={drawing} ({error}); unset or install it."
        ) from error
    kind = get_type_hints(module.run, include_extras=True)["args"]
    args = read_options(kind, f"hop {verb}", inspect.getdoc(module), rest)
    if (file := getattr(args, "json", None)) and not os.access(file, os.W_OK):
        place = next(place for place in file.absolute().parents if place.exists())
        if not (place.is_dir() and os.access(place, os.W_OK)):
            raise UsageError(f"--json {file} cannot be written; give another file.")
    module.run(args)
    return 0


def read_options(options: Any, program: str, about: str | None, words: Sequence[str]) -> Any:  # noqa: ANN401
    """Return an instance of a dataclass of options, or of one of a union's, as subcommands.

    Lists may be given with commas or spaces. SystemExit ends the program after it has printed the
    help that was asked for, or what is wrong with the words.
    """
    apart = list[str]()
    for word in words:
        listed = _LIST.fullmatch(word) and not os.path.exists(word)  # noqa: PTH110
        apart += word.split(",") if listed else [word]
    if "--no-video" in apart:  # asked of evaluations, which make none
        apart.remove("--no-video")
    return tyro.cli(options, prog=program, description=about, args=apart, config=_CONFIG)
