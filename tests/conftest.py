"""Test set-up shared by all rooms."""

import functools
import http.server
import threading

import pytest
from hypothesis import settings

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
    """A browser without a screen."""
    pytest.importorskip("viser", reason="the extra 'view' is not installed")
    pytest.importorskip("playwright", reason="playwright is not installed")
    from tests.browser import chromium, find_chromium

    if find_chromium() is None:
        pytest.skip("there is no Chromium on this computer")
    with chromium() as running:
        yield running


_HARMLESS = "Tried to update non-existent component"
"""What viser's page says where an update and the removal of what it updates cross."""

_ENDED = "ERR_ABORTED"
"""How a request fails whose page was closed."""


@pytest.fixture
def page(browser):
    """An empty page; in the end nothing may have been complained of or loaded from afar."""
    from tests.browser import new_page

    complaints, far = [], []
    page = new_page(browser)
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("requestfailed", lambda r: complaints.append(f"{r.url}: {r.failure}"))
    page.on("request", lambda r: far.append(r.url) if "127.0.0.1" not in r.url else None)
    yield page
    page.close()
    assert [
        text for text in complaints if not text.startswith(_HARMLESS) and _ENDED not in text
    ] == []
    assert [url for url in far if not url.startswith(("data:", "blob:"))] == []


@pytest.fixture
def foreign(browser, tmp_path):
    """A page of another site, served by this computer so that the browser alone forbids nothing."""
    from tests.browser import new_page

    (tmp_path / "index.html").write_text("<p>")
    serve = functools.partial(http.server.SimpleHTTPRequestHandler, directory=tmp_path)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), serve) as site:
        threading.Thread(target=site.serve_forever, daemon=True).start()
        page = new_page(browser)
        page.goto(f"http://127.0.0.1:{site.server_port}")
        yield page
        page.close()
        site.shutdown()
