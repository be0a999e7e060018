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
    """Put results of the studies, notebooks and the live page beside the pages (for mkdocs)."""
    for path in sorted([*ROOT.glob("studies/*/results/*"), *ROOT.glob("studies/*/figures/*")]):
        address = f"results/{path.parts[-3]}/{path.name}"
        files.append(File.generated(config, address, abs_src_path=str(path)))
    for address, content in (macros_live.pages() | macros_notebooks.pages()).items():
        files.append(File.generated(config, address, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:  # noqa: ANN401
    """Fill one page (called by mkdocs)."""
    environment = jinja2.Environment(
        undefined=jinja2.StrictUndefined, autoescape=False, keep_trailing_newline=True
    )
    try:
        text = environment.from_string(markdown).render(MACROS)
    except (jinja2.TemplateError, OSError, LookupError, TypeError, ValueError) as error:
        raise PluginError(f"docs/{page.file.src_uri}: {type(error).__name__}: {error}") from error
    return text.replace("](results/", "](" + "../" * page.file.src_uri.count("/") + "results/")
