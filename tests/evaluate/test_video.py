import io

import numpy as np
import pytest
from PIL import Image

from hopping_leg.evaluate.video import CLIP_SECONDS, FRAME_RATE, clip, fixed_traces, render_video


@pytest.fixture(scope="module")
def traces(judged):
    return fixed_traces(judged.runs, judged.evaluation.controllers[0])


def test_a_clip_begins_at_an_apex_after_the_start(traces):
    poses = clip(traces[0.35])
    assert poses.shape == (round(CLIP_SECONDS * FRAME_RATE), 3)
    assert poses[1, 0] < poses[0, 0]
    assert np.ptp(poses[:, 0]) > 0.05


def test_without_opengl_there_is_a_reason_instead(robot, traces, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    video = render_video(robot, traces)
    assert video.content is None
    assert video.reason.startswith("nonsense: ")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["webp", "gif"])
def test_a_video_moves_or_says_why_there_is_none(kind, robot, traces):
    video = render_video(robot, traces, kind)
    if video.content is None:
        assert video.reason
        return
    image = Image.open(io.BytesIO(video.content))
    assert image.format == kind.upper()
    assert image.n_frames == round(CLIP_SECONDS * FRAME_RATE)
    first = np.asarray(image.convert("RGB"), dtype=float)
    image.seek(image.n_frames // 2)
    assert np.abs(np.asarray(image.convert("RGB"), dtype=float) - first).max() > 50
