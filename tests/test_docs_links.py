"""The documentation's links hold, its site builds, and its blocks with numbers are current."""

import re
import subprocess
import sys
from urllib.parse import urlsplit

import pytest

from tests.doc_pages import DOCS, PAGES, ROOT

_FILES = re.compile(r"`((?:examples|docs|src|tests|studies)/[\w./-]*)`")
_LINKS = re.compile(r"\]\(([^)\s]+)\)")


def run(*words):
    done = subprocess.run([sys.executable, *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_site_builds_without_a_dead_link(tmp_path):
    run(str(DOCS / "make_site.py"), str(tmp_path / "site"))
    assert (tmp_path / "site" / "api" / "hopping_leg.trace" / "index.html").is_file()
    told = (DOCS / "zensical.toml").read_text(encoding="utf-8")
    assert [page.name for page in DOCS.glob("*.md") if f'"{page.name}"' not in told] == []


def test_blocks_with_numbers_are_current():
    run(str(DOCS / "render.py"), "--check")


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_files_of_the_repository_and_to_well_formed_addresses(page):
    text = PAGES[page].read_text(encoding="utf-8")
    assert "{{" not in text
    assert [name for name in _FILES.findall(text) if not (ROOT / name).exists()] == []
    for link in _LINKS.findall(text):
        target = urlsplit(link)
        if target.scheme:
            assert target.scheme == "https", link
            assert re.fullmatch(r"[a-z0-9-]+(\.[a-z0-9-]+)+", target.netloc), link
        elif target.path and target.path.split("/")[0] not in ("live", "notebooks"):
            assert (PAGES[page].parent / target.path).exists(), link
