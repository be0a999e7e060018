"""The documentation's links: none is dead, and every page is near the front page."""

import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from urllib.parse import unquote, urljoin, urlsplit

import pytest

from tests.doc_pages import DOCS, PAGES, ROOT

CLICKS = 2
"""From the front page to any other."""

_FILES = re.compile(r"`((?:examples|docs|src|tests|studies)/[\w./-]*)`")
_LINKS = re.compile(r"\]\(([^)\s]+)\)")


class Page(HTMLParser):
    """A built page: where its links go, and which anchors it has."""

    def __init__(self, text):
        super().__init__()
        self.links, self.anchors = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.anchors |= {found[name] for name in ("id", "name") if found.get(name)}
        for name in ("href", "src"):
            if found.get(name):
                self.links.append(found[name])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Build the documentation; return its pages by their address from the root."""
    folder = tmp_path_factory.mktemp("site")
    words = ["mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    built = subprocess.run([sys.executable, "-m", *words], cwd=ROOT, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    texts = {file: file.read_text(encoding="utf-8") for file in folder.rglob("*.html")}
    return folder, {
        "/" + file.relative_to(folder).as_posix().removesuffix("index.html"): Page(text)
        for file, text in texts.items()
        if file.name != "404.html"
    }


def inside(address: str, page: Page) -> Iterator[tuple[str, str]]:
    """Yield the path and the anchor of every link of a page that stays on the site."""
    for link in page.links:
        target = urlsplit(urljoin(address, link))
        if not target.scheme and not target.netloc:
            yield unquote(target.path), unquote(target.fragment)


@pytest.mark.slow
def test_no_link_inside_the_site_is_dead_and_every_page_is_two_clicks_away(site):
    folder, pages = site
    dead = []
    for address, page in pages.items():
        for path, anchor in inside(address, page):
            known = pages.get(path)
            if known is None and not (folder / path.lstrip("/")).is_file():
                dead.append(f"{address} -> {path}")
            elif known and anchor and anchor not in known.anchors:
                dead.append(f"{address} -> {path}#{anchor}")
    assert not dead
    assert len(pages) >= len(PAGES) - 1  # the README is no page of the site
    reached = {"/"}
    for _ in range(CLICKS):
        steps = [path for address in reached for path, _ in inside(address, pages[address])]
        reached |= pages.keys() & set(steps)
    assert reached == pages.keys()


@pytest.mark.parametrize("page", PAGES)
def test_links_elsewhere_are_well_formed_and_named_files_exist(page):
    text = PAGES[page].read_text(encoding="utf-8")
    assert [name for name in _FILES.findall(text) if not (ROOT / name).exists()] == []
    for link in _LINKS.findall(text):
        target = urlsplit(link)
        if target.scheme:
            assert target.scheme == "https", link
            assert re.fullmatch(r"[a-z0-9-]+(\.[a-z0-9-]+)+", target.netloc), link
        elif page == "README":
            assert (ROOT / target.path).exists(), link


def test_blocks_with_numbers_are_current():
    words = [sys.executable, str(DOCS / "render.py"), "--check"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
