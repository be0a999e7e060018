"""Fills documentation pages with numbers from the studies and from the package, at build time.

A page may hold ``{{ table(...) }}``, ``{{ value(...) }}``, ``{{ robot(...) }}``,
``{{ usage(...) }}`` and the like; a missing file or entry stops the build, so no page can show a
number that no longer exists. Where a study has stored nothing yet, ``{{ tables(...) }}`` and
``{{ training(...) }}`` say so. ``results/STUDY/FILE`` on the site is ``studies/STUDY/results/FILE``
or a figure of the study. mkdocs puts this folder on the path while it loads this hook.
"""

import contextlib
import io
import os
import re
import sys
from pathlib import Path
from typing import Any

import jinja2

sys.path.insert(0, str(Path(__file__).parent.parent))  # for the studies, which are not installed
import macros_live
import macros_notebooks
import macros_package
import macros_results
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

from hopping_leg import cli

ROOT = Path(__file__).parent.parent


def usage(*arguments: str) -> str:
    """Return the help text of a command."""
    os.environ |= {"COLUMNS": "100", "NO_COLOR": "1"}
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        cli.main([*arguments, "--help"])
    return f"```text\n$ hop {' '.join((*arguments, '--help'))}\n{text.getvalue().rstrip()}\n```"


def example(file: str) -> str:
    """Return a file of examples/ as it is."""
    return (ROOT / "examples" / file).read_text(encoding="utf-8").rstrip()


MACROS = {
    **macros_results.MACROS,
    **macros_package.MACROS,
    "example": example,
    "usage": usage,
    "verbs": list(cli.VERBS),
}


def on_files(files: Files, config: Any) -> Files:  # noqa: ANN401
    """Put studies with their results, notebooks and the live page beside the pages (for mkdocs)."""
    for kind in ("README.md", "results/*", "figures/*"):
        for path in sorted(ROOT.glob(f"studies/*/{kind}")):
            address = path.relative_to(ROOT).as_posix()
            files.append(File.generated(config, address, abs_src_path=str(path)))
    for address, content in (macros_live.pages() | macros_notebooks.pages()).items():
        files.append(File.generated(config, address, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:  # noqa: ANN401
    """Let links lead to where the site has what the repository has elsewhere (for mkdocs)."""
    if page.file.src_uri.startswith("studies/"):
        return markdown.replace("](../../docs/", "](../../")
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, autoescape=False, keep_trailing_newline=True
    )
    try:
        text = environment.from_string(markdown).render(MACROS)
    except (jinja2.TemplateError, OSError, LookupError, TypeError, ValueError) as error:
        raise PluginError(f"docs/{page.file.src_uri}: {type(error).__name__}: {error}") from error
    up = "../" * page.file.src_uri.count("/")
    text = re.sub(r"\]\(results/(\w+)/([\w.-]+json)\)", rf"]({up}studies/\1/results/\2)", text)
    text = re.sub(r"\]\(results/(\w+)/([\w.-]+)\)", rf"]({up}studies/\1/figures/\2)", text)
    return re.sub(r"\]\((\.\./)+studies/", f"]({up}studies/", text)
