"""Print a script that completes verbs, options and their choices of `hop` in a shell.

Examples:
  hop completion bash > ~/.local/share/bash-completion/completions/hop
  hop completion fish > ~/.config/fish/completions/hop.fish
  hop completion zsh > ~/.zfunc/_hop      # with fpath+=~/.zfunc before compinit
"""

import contextlib
import dataclasses
import importlib
import io
import typing
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union

import tyro

from hopping_leg import cli


@dataclass(frozen=True)
class Completion:
    """Which shell."""

    shell: tyro.conf.Positional[Literal["bash", "zsh", "fish"]]
    """Whose script is printed."""


def run(args: Completion) -> None:
    """Print the script."""
    verbs: Any = Union[tuple(_verb(name, line) for name, line in cli.VERBS.items())]  # noqa: UP007
    text = io.StringIO()
    # tyro prints and exits.
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        tyro.cli(
            verbs,
            prog="hop",
            args=["--tyro-print-completion", args.shell],
            config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
        )
    print("\n".join(map(_on_one_line, text.getvalue().splitlines())))


def _on_one_line(line: str) -> str:
    """Join help texts of several lines, whose later lines the script would offer as words."""
    return line.replace("\\n", " ") if line.startswith("COMPLETION_SPEC") else line


def _verb(name: str, line: str) -> Any:  # noqa: ANN401
    """Return a verb as a subcommand, its own subcommands a level below."""
    module = importlib.import_module(f"hopping_leg.cli.{name}")
    options = typing.get_type_hints(module.run, include_extras=True)["args"]
    level = dataclasses.make_dataclass(name.capitalize(), [("args", options)])
    return Annotated[level, tyro.conf.subcommand(name=name, description=line)]
