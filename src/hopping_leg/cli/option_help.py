"""A verb's options as its dataclass has them: their help at any width, near names, lists.

tyro reads the command line; what is here says what there is to read.
"""

import ast
import dataclasses
import inspect
import itertools
import math
import re
import shutil
import textwrap
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro

from hopping_leg.errors import UsageError, nearest_names, unknown_name

_WIDEST, _NARROWEST = 100, 30
_COLUMN = 18
"""Width of an option's name beside its text; a longer one stands above it."""

_VALUES = {int: "N", float: "NUMBER", str: "NAME", Path: "PATH"}
_HELP = "--help"

MEANT = {
    "--commands": "heights height command targets apexes",
    "--heights": "commands height range",
    "--command": "height commands heights target",
    "--out": "output output-dir outdir folder dir save-dir logdir",
    "--robot": "model leg robot-file urdf config",
    "--seconds": "duration time length",
    "--seeds": "repeats trials episodes runs",
    "--seed": "random-seed rng",
    "--steps": "timesteps total-timesteps iterations epochs n-steps",
    "--minutes": "time duration budget",
    "--threads": "cpus cores jobs workers n-jobs",
    "--workers": "cpus cores jobs threads n-jobs",
    "--jobs": "cpus cores workers threads n-jobs",
    "--no-browser": "headless no-gui no-open",
    "--no-noise": "noiseless clean",
    "--timestep": "dt step",
    "--rate": "frequency freq hz",
    "--recipe": "algorithm algo policy method",
    "--resume": "continue load restart",
    "--transport": "device port interface can",
    "--yes": "force no-confirm y",
    "--floor": "ground contact terrain",
    "--json": "output-json save export",
    "--report": "html",
    "--no-video": "no-render",
    "--set": "override param params",
}
"""Options with the words that others use for them."""


@dataclasses.dataclass(frozen=True)
class Option:
    """One option, or a word that stands by itself."""

    name: str
    """As it is given, e.g. ``--seeds``; of a word by itself what stands for it."""
    hint: Any
    """Its type, with tyro's marks."""
    text: str
    default: Any = dataclasses.MISSING
    positional: bool = False

    @property
    def is_switch(self) -> bool:
        """Whether it takes no value."""
        return _bare(self.hint) is bool

    @property
    def of_numbers(self) -> bool:
        """Whether its value, or each of its values, is a number."""
        bare = _bare(self.hint)
        return bool({int, float} & {bare, *get_args(bare)})

    @property
    def invocation(self) -> str:
        """How it is given, e.g. ``--seeds N``."""
        if self.positional:
            return self.name
        if self.is_switch:
            return f"--no-{self.name[2:]}" if self.default is True else self.name
        return f"{self.name} {value_name(self.hint)}"

    @property
    def said(self) -> str:
        """Its text with its default, unless that is nothing or stands there already."""
        text, value = self.text, self.default
        if self.is_switch:
            return text + (" On unless switched off." if value is True else "")
        if value is dataclasses.MISSING:
            return text if self.positional else f"{text} Needed."
        if value in (None, (), "", math.inf) or "default:" in text:
            return text
        values = value if isinstance(value, tuple) else (value,)
        shown = " ".join(f"{v:g}" if isinstance(v, float) else str(v) for v in values)
        return f"{text} Default: {shown}."


def kinds_of(options: Any) -> dict[str, tuple[type, Any]]:  # noqa: ANN401
    """Return the dataclasses of a union by the word that chooses one, each with its defaults."""
    if get_origin(options) not in (Union, types.UnionType):
        return {}
    found = {}
    for part in get_args(options):
        kind, marks = (part, ()) if isinstance(part, type) else (get_args(part)[0], marks_of(part))
        word, defaults = word_of(kind), None
        for mark in marks:
            word = getattr(mark, "name", None) or word
            given = getattr(mark, "default", None)
            defaults = given if isinstance(given, kind) else defaults
        found[word] = (kind, defaults)
    return found


def word_of(kind: type) -> str:
    """Return the word that tyro gives to a dataclass, e.g. ``energy-shaping``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", kind.__name__).lower()


def options_of(kind: type, instance: Any = None) -> list[Option]:  # noqa: ANN401
    """Return the options of a dataclass and of those among its fields, in their order."""
    found: list[Option] = []
    hints, texts = get_type_hints(kind, include_extras=True), field_texts(kind)
    for field in dataclasses.fields(kind):
        hint = hints[field.name]
        marks = list(marks_of(hint))
        default = _default(field) if instance is None else getattr(instance, field.name)
        if any("Suppress" in str(mark) for mark in marks):
            continue
        if dataclasses.is_dataclass(bare := _bare(hint)):
            given = None if default is dataclasses.MISSING else default
            found += options_of(typing.cast(type, bare), given)
            continue
        said = next((m.help for m in marks if getattr(m, "help", None)), None)
        positional = any(mark is tyro.conf.Positional for mark in marks)
        name = f"--{field.name.replace('_', '-')}"
        if positional:
            many = " ..." if get_origin(bare) is tuple else ""
            name = field.name.upper().removesuffix("S" if many else "") + many
        found.append(Option(name, hint, said or texts.get(field.name, ""), default, positional))
    return found


def field_texts(kind: type) -> dict[str, str]:
    """Return the docstrings of a dataclass's fields, each on one line."""
    found: dict[str, str] = {}
    for owner in reversed(kind.__mro__[:-1]):
        found |= _own_texts(owner)
    return found


@cache
def _own_texts(kind: type) -> dict[str, str]:
    try:
        tree: Any = ast.parse(textwrap.dedent(inspect.getsource(kind)))
    except (OSError, TypeError):  # made at run time
        return {}
    body = tree.body[0].body
    return {
        entry.target.id: " ".join(after.value.value.split()).replace("``", "`")
        for entry, after in itertools.pairwise(body)
        if isinstance(entry, ast.AnnAssign) and isinstance(entry.target, ast.Name)
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        if isinstance(after.value.value, str)
    }


def _default(field: "dataclasses.Field[Any]") -> Any:  # noqa: ANN401
    made = field.default_factory
    return field.default if made is dataclasses.MISSING else made()


def marks_of(hint: object) -> Iterator[Any]:
    """Yield tyro's marks of a type."""
    yield from getattr(hint, "__metadata__", ())
    for part in get_args(hint):
        yield from marks_of(part)


def _bare(hint: Any) -> Any:  # noqa: ANN401
    """Return a type without marks and without None."""
    if get_origin(hint) is Annotated:
        return _bare(get_args(hint)[0])
    if get_origin(hint) in (Union, types.UnionType):
        parts = [part for part in get_args(hint) if part is not type(None)]
        return _bare(parts[0]) if len(parts) == 1 else hint
    return hint


def value_name(hint: Any) -> str:  # noqa: ANN401
    """Return what stands for an option's value, e.g. ``PATH`` or ``soft|stiff``."""
    bare = _bare(hint)
    said = next((m.metavar for m in marks_of(hint) if getattr(m, "metavar", None)), None)
    if said:
        return str(said)
    if get_origin(bare) is Literal:
        return "|".join(map(str, get_args(bare)))
    if get_origin(bare) is tuple:
        parts = get_args(bare)
        if parts[-1] is Ellipsis:
            return f"{value_name(parts[0])} ..."
        return " ".join(map(value_name, parts))
    return _VALUES.get(bare, "VALUE")


def show_help(options: Any, program: str, about: str | None, words: Sequence[str]) -> str:  # noqa: ANN401
    """Return the help of a verb, or of the kind of it that the words name."""
    kinds = kinds_of(options)
    chosen = next((word for word in words if word in kinds), None)
    if chosen is not None:
        kind, instance = kinds[chosen]
        return _page(f"{program} {chosen}", inspect.getdoc(kind), options_of(kind, instance))
    if not kinds:
        return _page(program, about, options_of(options))
    about_kinds = [(name, inspect.getdoc(kind) or "") for name, (kind, _) in kinds.items()]
    table = columns([(name, text.split("\n\n")[0]) for name, text in about_kinds])
    usage = f"usage: {program} {'|'.join(kinds)} [options]"
    more = wrapped(f"`{program} WORD --help` shows the options behind each of these words.")
    return "\n\n".join([wrapped(usage, "  "), *_paragraphs(about or ""), table, more])


def _page(program: str, about: str | None, options: list[Option]) -> str:
    alone = [option for option in options if option.positional]
    named = [option for option in options if not option.positional]
    usage = " ".join(["usage:", program, *(option.name for option in alone), "[options]"])
    rows = [(option.invocation, option.said) for option in (*alone, *named)]
    return "\n\n".join([wrapped(usage, "  "), *_paragraphs(about or ""), columns(rows)])


def _width() -> int:
    return max(_NARROWEST, min(_WIDEST, shutil.get_terminal_size().columns))


def wrapped(text: str, hanging: str = "") -> str:
    """Return a text in lines that fit the terminal."""
    return textwrap.fill(
        text, _width(), subsequent_indent=hanging, break_on_hyphens=False, break_long_words=False
    )


def _paragraphs(text: str) -> list[str]:
    """Return paragraphs wrapped; of a list, e.g. of examples, each line by itself."""
    shown = []
    for paragraph in filter(None, text.strip().split("\n\n")):
        lines = paragraph.splitlines()
        if any(line.startswith("  ") for line in lines):
            shown.append("\n".join(map(_example, lines)))
        else:
            shown.append(wrapped(" ".join(lines)))
    return shown


def _example(line: str) -> str:
    """Return a command, where it is too long in lines that the shell still reads as one."""
    if len(line) <= _width():
        return line
    words, _, comment = line.strip().partition(" #")
    lines = textwrap.wrap(
        words, _width() - 2, initial_indent="  ", subsequent_indent="    ",
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip
    above = [wrapped(f"  #{comment}", "  # ")] if comment else []
    return "\n".join([*above, " \\\n".join(lines)])


def columns(rows: Sequence[tuple[str, str]]) -> str:
    """Return names with their texts beside them, or below a long one or on a narrow screen."""
    width, lines = _width(), list[str]()
    column = min(_COLUMN, max((len(name) for name, _ in rows), default=0))
    column = 4 if width < 60 else column + 4
    for name, text in rows:
        behind = textwrap.wrap(
            text, width - column, break_on_hyphens=False, break_long_words=False
        ) or [""]
        if len(name) + 4 > column:
            lines += textwrap.wrap(
                name, width, initial_indent="  ", subsequent_indent="      ",
                break_on_hyphens=False, break_long_words=False,
            )  # fmt: skip
        else:
            lines.append(f"  {name:<{column - 4}}  {behind.pop(0)}".rstrip())
        lines += [f"{'':<{column}}{line}".rstrip() for line in behind]
    return "\n".join(lines)


def tidy_words(options: Any, program: str, words: Sequence[str]) -> list[str]:  # noqa: ANN401
    """Return the words of a command line as tyro reads them.

    Lists may be given with commas or spaces; a word behind a list of numbers that is none stands
    by itself.

    Raises:
        UsageError: A word names no option or is no value of its option, one is given twice or
            lacks its value, or no kind of the verb is named.
    """
    kinds = kinds_of(options)
    if kinds:
        asked = words[0] if words else ""
        if asked not in kinds:
            said = f"There is no {program} '{asked}'" if asked else f"{program} needs another word"
            raise UsageError(f"{said}.{hint_of(asked, kinds)} Available: {', '.join(kinds)}.")
        program, known = f"{program} {asked}", options_of(*kinds[asked])
    else:
        known = options_of(options)
    alone = [option for option in known if option.positional]
    given = _sorted_words(program, known, words[1:] if kinds else words)
    stray = [part for word in given.pop("") for part in _parts(word, alone[0] if alone else None)]
    if stray and not alone:
        robot = stray[0].endswith(".toml") and any(option.name == "--robot" for option in known)
        meant = f" Did you mean --robot {stray[0]}?" if robot else ""
        raise UsageError(
            f"{program} takes no word by itself, but '{stray[0]}' stands there.{meant}"
        )
    if len(stray) < sum(option.default is dataclasses.MISSING for option in alone):
        missing = alone[len(stray)]
        raise UsageError(f"{program} needs {missing.name}: {missing.text}")
    flags = _flags(known)
    for option in known:
        if option.default is dataclasses.MISSING and not (
            option.positional or option.name in given
        ):
            raise UsageError(f"{program} needs {option.invocation}: {option.text}")
    for flag, values in given.items():
        _check_values(flag, flags[flag], values)
    behind = [word for flag, values in given.items() for word in (flag, *values)]
    return [*(words[:1] if kinds else ()), *stray, *behind]


def _sorted_words(
    program: str, known: Sequence[Option], words: Sequence[str]
) -> dict[str, list[str]]:
    """Return the values behind each flag, and below "" the words that stand by themselves."""
    flags, found = _flags(known), dict[str, list[str]]({"": []})
    flag, alone = "", any(option.positional for option in known)
    for word in words:
        if word.startswith("--") and len(word) > 2:
            flag, equals, value = word.partition("=")
            flag = flag.replace("_", "-")
            if flag not in flags:
                near = hint_of(flag, flags, MEANT)
                raise UsageError(
                    f"{program} has no option {flag}.{near} `{program} {_HELP}` shows all."
                )
            if flag in found:
                raise UsageError(
                    f"{flag} is given twice; give it once, with all its values behind it."
                )
            found[flag] = _parts(value, flags[flag]) if equals else []
            continue
        option, values = flags.get(flag), found[flag]
        many = option is not None and get_origin(_bare(option.hint)) is tuple
        full = option is not None and (option.is_switch or (bool(values) and not many))
        foreign = many and option is not None and option.of_numbers and not _is_numbers(word)
        if alone and (full or (foreign and values)):
            found[""].append(word)
        else:
            values += _parts(word, option) if option else [word]
    return found


def _check_values(flag: str, option: Option, values: Sequence[str]) -> None:
    bare = _bare(option.hint)
    if option.is_switch:
        if values:
            raise UsageError(f"{flag} takes no value, but '{values[0]}' stands behind it.")
        return
    if not values:
        raise UsageError(f"{flag} needs a value; give {flag} {value_name(option.hint)}.")
    if get_origin(bare) is Literal and values[0] not in map(str, get_args(bare)):
        raise UsageError(unknown_name(f"value of {flag}", values[0], map(str, get_args(bare))))
    if option.of_numbers:
        what = "a whole number" if int in (bare, *get_args(bare)) else "a number"
        for value in values:
            if not _is_numbers(value) or ("whole" in what and not re.fullmatch(r"[+-]?\d+", value)):
                raise UsageError(f"{flag} is '{value}' but must be {what}.")


def _flags(options: Sequence[Option]) -> dict[str, Option]:
    found = {option.name: option for option in options if not option.positional}
    found |= {f"--no-{name[2:]}": option for name, option in found.items() if option.is_switch}
    return found


def hint_of(
    name: str, valid: Sequence[str] | Mapping[str, Any], meant: Mapping[str, str] | None = None
) -> str:
    """Return a sentence with the names that are nearest, or nothing."""
    near = nearest_names(name, valid, meant)
    return f" Did you mean {' or '.join(near)}?" if near else ""


def _parts(word: str, option: Option | None) -> list[str]:
    """Return a word as the entries of a list, if it has commas and belongs to one."""
    bare = _bare(option.hint) if option else None
    kind = get_args(bare)[0] if get_origin(bare) is tuple else None
    parts = [part.strip() for part in word.split(",") if part.strip()]
    if kind is None or (len(parts) < 2 and parts == [word]):
        return [word]
    if kind in (int, float) or not any(sign in word for sign in "*?[=/"):
        return [word] if Path(word).exists() else parts
    named = [re.match(r"[\w.]+=", part) is not None for part in parts]
    alike = all(named) or all(Path(part).exists() for part in parts)
    return parts if alike and not Path(word).exists() else [word]


def _is_numbers(word: str) -> bool:
    try:
        return bool([float(part) for part in word.split(",") if part.strip()])
    except ValueError:
        return False
