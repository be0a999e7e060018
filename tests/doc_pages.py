"""The README and the pages of docs/: their blocks of code, and the commands in them."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = {"README": ROOT / "README.md", **{p.stem: p for p in sorted(DOCS.glob("*.md"))}}

_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_RENDERED = re.compile(r"<!-- render.*?<!-- /render -->", re.DOTALL)
_INLINE = re.compile(r"(?<!`)`(hop [^`]+)`(?!`)")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page that is not rendered; examples have tests of their own."""

    language: str
    text: str

    def commands(self) -> list[list[str]]:
        """Return its commands, split into words as a shell does, without comments."""
        lines = self.text.splitlines()
        return [words for line in lines if (words := shlex.split(line, comments=True))]


def text_of(page: str) -> str:
    """Return a page without what is rendered into it."""
    return _RENDERED.sub("", PAGES[page].read_text(encoding="utf-8"))


def blocks(page: str) -> list[Block]:
    """Return a page's fenced blocks in order."""
    return [Block(*found.groups()) for found in _BLOCK.finditer(text_of(page))]


def inline_commands(page: str) -> list[list[str]]:
    """Return what stands in running text as `hop ...`; files and values may be left open there."""
    return [words.split() for words in _INLINE.findall(text_of(page))]
