"""Build the site into ``site/``, or a given folder: pages, studies, notebooks, live page and API.

Zensical renders one folder; what belongs in it is gathered first. A link or an anchor that leads
nowhere ends the build.
"""

import importlib
import re
import shutil
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT))  # a page's numbers name studies

import live_page  # noqa: E402
import notebooks  # noqa: E402

_MODULE = re.compile(r"^::: (\S+)$", re.MULTILINE)


def gather() -> dict[str, bytes | str]:
    """Return all files of the site's source by their addresses."""
    pages = {path.name: path.read_text(encoding="utf-8") for path in DOCS.glob("*.md")}
    modules = _MODULE.findall(pages["api.md"])
    pages["api.md"] = _MODULE.sub(lambda found: _entry(found[1]), pages["api.md"])
    files: dict[str, bytes | str] = {
        # On the site, docs/ is the root, in which studies/ is.
        name: re.sub(r"\]\(\.\./studies/", "](studies/", text)
        for name, text in pages.items()
    }
    for name in modules:
        files[f"api/{name}.md"] = f"# {name.removeprefix('hopping_leg.')}\n\n::: {name}\n"
    for path in (*DOCS.glob("*.png"), DOCS / "style.css"):
        files[path.name] = path.read_bytes()
    for kind in ("README.md", "results/*", "figures/*"):
        for path in sorted(ROOT.glob(f"studies/*/{kind}")):
            content = path.read_bytes().replace(b"](../../docs/", b"](../../")
            files[path.relative_to(ROOT).as_posix()] = content
    return files | live_page.pages() | notebooks.pages()


def _entry(name: str) -> str:
    """Return a module as an entry of the list of all."""
    about = (importlib.import_module(name).__doc__ or "").partition("\n")[0]
    return f"- [`{name}`](api/{name}.md): {about}"


def build(folder: Path) -> None:
    """Gather and render into a folder; end the program where a link is dead."""
    work = ROOT / "build" / "site"
    shutil.rmtree(work, ignore_errors=True)
    for address, content in gather().items():
        file = work / "pages" / address
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
    shutil.copy(DOCS / "zensical.toml", work)
    words = [sys.executable, "-m", "zensical", "build", "--strict", "-f", work / "zensical.toml"]
    if subprocess.run(words).returncode:  # which has said why
        sys.exit(1)
    shutil.rmtree(folder, ignore_errors=True)
    shutil.move(work / "site", folder)


if __name__ == "__main__":
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "site")
