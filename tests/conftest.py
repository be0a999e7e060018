"""Test set-up shared by all rooms."""

import pytest
from hypothesis import settings

from tests.browser import FLAGS, PATIENCE, find_chromium, new_page, serving

settings.register_profile("steady", deadline=None, derandomize=True)
settings.load_profile("steady")


@pytest.fixture(autouse=True, scope="session")
def learners_log_where_tests_do(tmp_path_factory):
    """Keep stable-baselines3, which logs unless told otherwise, out of the system's folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SB3_LOGDIR", str(tmp_path_factory.mktemp("logs")))
        yield


@pytest.fixture(scope="module")
def browser():
    """A browser without a screen and with an empty profile."""
    pytest.importorskip("viser", reason="the extra 'view' is not installed")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if (path := find_chromium()) is None:
        pytest.skip("there is no Chromium on this computer")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=FLAGS, timeout=PATIENCE)
        yield browser
        browser.close()


HARMLESS = ("Tried to update non-existent component", "ERR_ABORTED")
"""What viser's page says where an update and the removal of what it updates cross, and how a
request fails whose page was closed."""


@pytest.fixture
def page(browser):
    """An empty page; in the end nothing may have been complained of or loaded from afar."""
    complaints, far = [], []
    page = new_page(browser)
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("requestfailed", lambda r: complaints.append(f"{r.url}: {r.failure}"))
    page.on("request", lambda r: far.append(r.url) if "127.0.0.1" not in r.url else None)
    yield page
    page.close()
    assert [text for text in complaints if not any(known in text for known in HARMLESS)] == []
    assert [url for url in far if not url.startswith(("data:", "blob:", "file:"))] == []


@pytest.fixture
def foreign(browser, tmp_path):
    """A page of another site, served by this computer so that the browser alone forbids nothing."""
    (tmp_path / "index.html").write_text("<p>")
    with serving(tmp_path) as address:
        page = new_page(browser)
        page.goto(address)
        yield page
        page.close()
