"""The page of `hop deploy --web` in a real browser without a screen."""

import pytest

from hopping_leg.deploy.height_page import HeightPage
from hopping_leg.deploy.keyboard import LiveHeight


@pytest.mark.slow
def test_slider_and_button_do_what_they_say(page):
    height, stops = LiveHeight(0.30, (0.22, 0.40)), []
    served = HeightPage(height, 0)
    with served.serve(lambda: stops.append("stop")):
        page.goto(served.address)
        page.get_by_text("0.30").wait_for()
        slider = page.get_by_role("slider", name="height in m")
        assert [slider.get_attribute(end) for end in ("min", "max")] == ["0.22", "0.4"]
        slider.press("ArrowRight")
        page.get_by_text("0.31").wait_for()
        assert height.at(0.0) == pytest.approx(0.31)
        slider.fill("0.4")
        page.get_by_text("0.40").wait_for()
        assert height.at(0.0) == pytest.approx(0.40)
        assert stops == []
        page.get_by_role("button", name="Stop the leg").click()
        page.get_by_text("Stopping.").wait_for()
        assert stops == ["stop"]
        page.close()
