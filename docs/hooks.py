"""What the site has besides the pages: studies with their results, notebooks and the live page.

mkdocs puts this folder on the path while it loads this hook.
"""

import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))

import live_page  # noqa: E402
import notebooks  # noqa: E402
from mkdocs.structure.files import File, Files  # noqa: E402


def on_files(files: Files, config: Any) -> Files:  # noqa: ANN401
    """Put studies, notebooks and the live page beside the pages (called by mkdocs)."""
    for kind in ("README.md", "results/*", "figures/*"):
        for path in sorted(ROOT.glob(f"studies/*/{kind}")):
            address = path.relative_to(ROOT).as_posix()
            files.append(File.generated(config, address, abs_src_path=str(path)))
    for address, content in (live_page.pages() | notebooks.pages()).items():
        files.append(File.generated(config, address, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:  # noqa: ANN401
    """Let links between docs/ and studies/ hold on the site, where both share a root."""
    if page.file.src_uri.startswith("studies/"):
        return markdown.replace("](../../docs/", "](../../")
    return re.sub(r"\]\(\.\./studies/", "](studies/", markdown)
