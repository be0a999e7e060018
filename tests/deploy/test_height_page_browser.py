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


_ATTACK = """async own => {
  const post = (path, body) => fetch(own + path, {method: "POST", mode: "no-cors", body});
  const sends = (path, body) => post(path, body).catch(() => "refused");
  const form = document.createElement("form"), frame = document.createElement("iframe");
  await Promise.all([sends("/stop", "{}"), sends("/height", '{"height": 0.4}')]);
  const read = await fetch(own + "/height").then(() => "read", () => "refused");
  const framed = new Promise(done => frame.onload = done);
  [frame.name, form.target, form.action, form.method] = ["f", "f", own + "/stop", "POST"];
  document.body.append(form, frame);
  form.submit();
  await framed;
  frame.src = own;
  await new Promise(done => frame.onload = done);
  return read;
}"""


@pytest.mark.slow
def test_a_page_of_another_site_can_neither_stop_nor_move_nor_read_nor_show_it(foreign):
    height, stops = LiveHeight(0.30, (0.22, 0.40)), []
    served = HeightPage(height, 0)
    with served.serve(lambda: stops.append("stop")):
        assert foreign.evaluate(_ATTACK, served.address) == "refused"
        assert height.at(0.0) == 0.30
        assert stops == []
        assert not any("Stop the leg" in frame.content() for frame in foreign.frames)
        foreign.goto(served.address)
        assert foreign.evaluate(_ATTACK, served.address) == "read"  # its own page may
        assert stops
        assert height.at(0.0) == 0.40
