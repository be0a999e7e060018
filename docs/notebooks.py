"""Notebooks as pages: run at build time, with what their cells print and draw.

As a run takes a while, what came out is kept in ``build/notebooks`` until a notebook changes;
``make clean`` forgets it.
"""

import base64
import hashlib
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).parent.parent
_KEPT = ROOT / "build" / "notebooks"


def pages() -> dict[str, str]:
    """Return every notebook of the examples as Markdown, by its address on the site."""
    found = {}
    for path in sorted(ROOT.glob("examples/notebooks/*.ipynb")):
        kept = _KEPT / f"{path.stem}-{hashlib.sha256(path.read_bytes()).hexdigest()[:16]}.md"
        if not kept.is_file():
            _KEPT.mkdir(parents=True, exist_ok=True)
            kept.write_text(_run(path), encoding="utf-8")
        found[f"notebooks/{path.stem}.md"] = kept.read_text(encoding="utf-8")
    return found


def _run(path: Path) -> str:
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=900, kernel_name="python3", resources=resources).execute()
    file = f"`examples/notebooks/{path.name}`"
    parts = [part for cell in notebook.cells for part in _cell(cell)]
    parts.insert(1, f"This page is {file}, as it ran when the documentation was built.")
    return "\n\n".join(parts) + "\n"


def _cell(cell: Any) -> list[str]:  # noqa: ANN401
    if cell.cell_type == "markdown":
        return [cell.source]
    shown = [_output(one) for one in cell.outputs]
    return [f"```python\n{cell.source}\n```", *filter(None, shown)]


def _output(output: Any) -> str:  # noqa: ANN401
    """Return what a cell has shown as Markdown: a picture, a table or text."""
    data = output.get("data", {})
    for kind in ("image/svg+xml", "image/png"):
        if kind in data:
            svg = kind.endswith("xml")
            content = base64.b64encode(data[kind].encode()).decode() if svg else data[kind].strip()
            return f'<img alt="" src="data:{kind};base64,{content}">'
    if "text/html" in data:
        return f'<div class="output">{"".join(data["text/html"].splitlines())}</div>'
    text = output.get("text") or data.get("text/plain", "")
    return f"```text\n{text.rstrip()}\n```" if text else ""
