"""The page in a real browser without a screen; skipped, with the reason, where there is none."""

import io
import time

import numpy as np
import pytest

pytest.importorskip("viser", reason="the extra 'view' is not installed")

from PIL import Image

from hopping_leg.viewer.live_leg import LiveSimulation
from hopping_leg.viewer.panels import HEIGHT_STEP, KEY_STEP
from hopping_leg.viewer.tracks import ReplaySource
from hopping_leg.viewer.viewer import Viewer
from tests.browser import PATIENCE, running, wait_for_leg
from tests.viewer.test_tracks import stored

pytestmark = pytest.mark.slow
ROBOT = "legv2-paper"


def until(condition):
    """Wait until a condition holds; fail if it never does."""
    end = time.monotonic() + 1e-3 * PATIENCE
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.05)


def slider(page, label):
    """Return the handle of the slider beside a label."""
    return page.locator(
        f"xpath=//label[normalize-space()='{label}']/following::*[@role='slider'][1]"
    )


def value_of(handle):
    return float(handle.get_attribute("aria-valuenow"))


def shows_apex(page, height):
    """Whether the page's last apex of the first leg is so high, m; it may show none yet."""
    try:
        shown = float(page.locator(".apex").first.inner_text().removesuffix(" m"))
    except ValueError:
        return False
    return shown == pytest.approx(height, abs=0.02)


def comes_to_rest(live):
    before = live.now
    time.sleep(0.2)
    return live.now == before


def choose(page, label, option):
    page.get_by_role("combobox", name=label, exact=True).click()
    page.get_by_role("option", name=option, exact=True).click()


def picture(page):
    """Return the middle of the page, as it is drawn now, rows x columns x (red, green, blue)."""
    middle = {"x": 330, "y": 60, "width": 520, "height": 700}
    shot = Image.open(io.BytesIO(page.screenshot(clip=middle))).convert("RGB")
    return np.asarray(shot, dtype=np.int16)


def share_of_the_motors(drawn):
    """Return how much of a picture has energy shaping's orange."""
    return ((drawn[..., 0] > 180) & (drawn[..., 2] < 60)).mean()


def test_the_leg_is_drawn_and_what_the_page_offers_changes_it_while_it_hops(page):
    live = LiveSimulation(("energy-shaping",), ROBOT, 0.26)
    viewer = Viewer(live, port=0)
    with running(viewer):
        wait_for_leg(page, viewer)
        # The page is connected before its meshes are drawn, seconds before on a busy computer.
        until(lambda: share_of_the_motors(picture(page)) > 0.005)
        first = picture(page)
        until(lambda: (np.abs(first - picture(page)).max(axis=-1) > 40).mean() > 0.005)
        until(lambda: shows_apex(page, 0.26))
        page.keyboard.press("k")
        until(lambda: live.height == pytest.approx(0.26 + KEY_STEP))
        page.keyboard.press("j")
        until(lambda: live.height == pytest.approx(0.26))
        page.keyboard.press("p")
        until(lambda: live._force > 0)
        page.keyboard.press("Space")
        until(lambda: viewer.clock.paused and comes_to_rest(live))
        still = live.now
        page.keyboard.press("s")
        until(lambda: live.now == pytest.approx(still + 1 / 200))
        page.keyboard.press("Space")
        slider(page, "Height, m").focus()
        for _ in range(round(0.08 / HEIGHT_STEP)):
            page.keyboard.press("ArrowRight")
        until(lambda: live.height == pytest.approx(0.34) and shows_apex(page, 0.34))
        assert page.locator("#command").inner_text() == "0.340"
        for label in ("Payload, kg", "Soft ground, s", "Delay, s"):
            slider(page, label).focus()
            page.keyboard.press("ArrowRight")
        until(lambda: live.settings.payload > 0 and live.settings.delay > 0)
        assert live.settings.time_constant == pytest.approx(0.0921, abs=1e-4)
        choose(page, "Controller", "fast")
        choose(page, "Beside it", "paper")
        until(lambda: live.names == ("fast", "paper"))
        page.locator(".apex").nth(1).wait_for()
        choose(page, "Robot", "legv2")
        until(lambda: live.robot.name == "legv2" and len(live.tracks[1]) > 20)


def test_a_trace_is_replayed(page, tmp_path):
    replay = ReplaySource((stored(tmp_path / "run.parquet", 3.0),))
    viewer = Viewer(replay, port=0)
    with running(viewer):
        wait_for_leg(page, viewer)
        page.keyboard.press("Space")
        until(lambda: viewer.clock.paused)
        handle = slider(page, "Time, s")
        # It shows where the replay stands, also where that stopped between two of its updates.
        until(lambda: value_of(handle) == pytest.approx(replay.now, abs=0.006))
        still = replay.now
        page.keyboard.press("s")
        until(lambda: replay.now > still)
        until(lambda: value_of(handle) == pytest.approx(replay.now, abs=0.006))
        handle.focus()
        page.keyboard.press("Home")
        until(lambda: replay.now == 0.0)
        page.keyboard.press("End")
        until(lambda: replay.now == pytest.approx(replay.length))
