"""The documentation's links: none is dead, and every page is near the front page."""

import importlib
import json
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


@pytest.fixture
def macros(monkeypatch, tmp_path):
    """The macros of tables, which read from a folder of this test's own."""
    pytest.importorskip("mkdocs")
    monkeypatch.syspath_prepend(str(DOCS))
    found = importlib.import_module("macros_results")
    monkeypatch.setattr(found, "STUDIES", tmp_path)
    yield found
    sys.modules.pop("macros_results", None)


def store(folder, rows):
    """Write a result of these rows and return its name."""
    file = folder / "s" / "results" / "e.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps({"summary": rows, "command": "hop evaluate"}))
    return "s/e.json"


def test_a_rival_is_beaten_only_where_intervals_are_apart(macros, tmp_path):
    def row(controller, command, middle):
        ends = {"low": middle - 0.001, "high": middle + 0.001}
        both = {f"{m}_{k}_m": v for m in ("mean_abs_error", "std") for k, v in ends.items()}
        return {"controller": controller, "command_m": command, "flight_fraction": command, **both}

    rows = [row("rival", c, 0.010) for c in (0.3, 0.4, 0.6)]
    rows += [row("mine", c, m) for c, m in ((0.3, 0.005), (0.4, 0.0115), (0.6, 0.015))]
    cells = macros.against(store(tmp_path, rows), "rival").splitlines()[2].split("|")
    assert cells[1].strip() == "mine"
    assert cells[2].strip() == "smaller at 1, larger at 1, not told apart at 1"
    assert cells[4].strip() == "smaller at 0, larger at 1, not told apart at 0"


def test_records_are_set_out_by_two_keys(macros, tmp_path):
    rows = [{"std_m": 0.003, "command_m": c, "controller": n} for c in (0.2, 0.3) for n in "ab"]
    table = macros.pivot(store(tmp_path, rows), "summary", "command_m", "controller", "{std_m:.3f}")
    assert table.splitlines()[0] == "| command_m | a | b |"
    assert table.splitlines()[3] == "| 0.3 | 0.003 | 0.003 |"
