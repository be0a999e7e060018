"""The README and the pages of docs/: their blocks of code, and the commands in them."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = {
    "README": ROOT / "README.md",
    **{str(p.relative_to(DOCS).with_suffix("")): p for p in sorted(DOCS.rglob("*.md"))},
}

_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_NO_PROSE = re.compile(r"<!-- render.*?<!-- /render -->|^```.*?^```$", re.DOTALL | re.MULTILINE)
_EXAMPLE = "<!-- render: example("
_INLINE = re.compile(r"(?<!`)`(hop [^`]+)`(?!`)")
_INDENTED = re.compile(r"^ {4,}(hop|python|make|pip) .*$", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    text: str
    where: str
    """Page and line, for messages."""

    is_example: bool
    """Whether it shows a file of examples/, which has a test of its own."""

    def commands(self) -> list[list[str]]:
        """Return its commands, split into words as a shell does, without comments."""
        lines = self.text.replace("\\\n", " ").splitlines()
        return [words for line in lines if (words := shlex.split(line, comments=True))]


def blocks(page: str) -> list[Block]:
    """Return a page's fenced blocks in order."""
    text, name = PAGES[page].read_text(encoding="utf-8"), PAGES[page].name
    return [
        Block(
            found[1],
            found[2],
            f"{name}:{text.count(chr(10), 0, found.start()) + 1}",
            _EXAMPLE in text[: found.start()].splitlines()[-2:][0],
        )
        for found in _BLOCK.finditer(text)
    ]


def prose(page: str) -> list[str]:
    """Return a page's headings, paragraphs, entries of lists and cells of tables as plain text."""
    text = _NO_PROSE.sub("", PAGES[page].read_text(encoding="utf-8"))
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    parts = re.split(r"\n\s*\n|\n(?=[-|#:]|\d\.)|\|", text)
    return [part for part in parts if re.search(r"\w", part)]


def inline_commands(page: str) -> list[list[str]]:
    """Return what stands in running text as `hop ...`; files and values may be left open there."""
    text = _NO_PROSE.sub("", PAGES[page].read_text(encoding="utf-8"))
    return [words.split() for words in _INLINE.findall(text)]


def indented_commands(page: str) -> list[str]:
    """Return commands in indented blocks, whose language nobody knows."""
    return [found[0].strip() for found in _INDENTED.finditer(PAGES[page].read_text("utf-8"))]


def with_files(words: list[str]) -> list[str]:
    """Return a command with its patterns replaced by the files that they match here."""
    found = [sorted(map(str, Path().glob(word))) if "*" in word else [word] for word in words]
    return [name for names in found for name in names]
