"""The report: one HTML page that holds everything and needs nothing."""

import dataclasses
from typing import Any

from markupsafe import Markup

from hopping_leg.evaluate import tables
from hopping_leg.evaluate.acceptance import acceptance_lines
from hopping_leg.evaluate.report_figures import Picture, draw_report_figures
from hopping_leg.evaluate.result import Evaluation, flat_conditions
from hopping_leg.evaluate.runner import EvaluationRun
from hopping_leg.evaluate.video import Video, fixed_traces, render_video
from hopping_leg.html_page import data_uri, page_template, svg_uri
from hopping_leg.robot.parameters import Robot

_NO_VIDEO = Video(None, "it was not asked for")


def write_report(judged: EvaluationRun, videos: dict[str, Video] | None = None) -> bytes:
    """Return the report as HTML.

    Args:
        judged: The evaluation and its runs.
        videos: Controller to its video; none are shown by default.
    """
    evaluation = judged.evaluation
    page = page_template("hopping_leg.evaluate", "report.html.j2").render(
        title=f"Hopping leg: {', '.join(evaluation.controllers)}",
        subtitle=_subtitle(evaluation),
        evaluation=evaluation,
        tables=_tables(evaluation),
        acceptance=acceptance_lines(map(dataclasses.asdict, evaluation.summary)),
        pictures=[_picture(p, evaluation) for p in draw_report_figures(evaluation, judged.runs)],
        videos=[_video(name, video) for name, video in (videos or {}).items()],
        conditions=flat_conditions({**evaluation.conditions, **evaluation.versions}),
    )
    return page.encode()


def render_videos(judged: EvaluationRun, robot: Robot) -> dict[str, Video]:
    """Render one video per controller; after a first failure the rest are not tried."""
    videos: dict[str, Video] = {}
    for name in judged.evaluation.controllers:
        failed = next((video for video in videos.values() if video.content is None), None)
        traces = fixed_traces(judged.runs, name)
        videos[name] = failed or (render_video(robot, traces) if traces else _NO_VIDEO)
    return videos


def _subtitle(evaluation: Evaluation) -> str:
    c = evaluation.conditions
    noisy = any(c["disturbance"][k] for k in ("joint_noise", "torque_noise", "delay_probability"))
    return (
        f"{c['robot']} on its {c['floor']} floor, {c['rate_hz']:g} Hz control,"
        f" {1e3 * c['timestep_s']:g} ms physics, {c['seeds']} seed{'' if c['seeds'] == 1 else 's'},"
        f" {'sensor noise, torque noise and delay on' if noisy else 'no noise, no delay'}"
    )


def _tables(evaluation: Evaluation) -> dict[str, Markup]:
    secondary = evaluation.secondary
    return {
        "summary": tables.summary_table(evaluation.summary),
        "groups": tables.group_table(evaluation.groups),
        "secondary": tables.summary_table(secondary.summary) if secondary else Markup(""),
        "estimators": tables.estimator_table(evaluation.estimators),
    }


def _picture(picture: Picture, evaluation: Evaluation) -> dict[str, Any]:
    beside = {
        "distributions": lambda: tables.neighbour_table(evaluation.neighbours),
        "staircase": lambda: tables.staircase_table(evaluation.staircase),
        "ladder": lambda: tables.ladder_table(evaluation.ladder),
    }
    files = picture.files
    shown = [*files[:2], "..."] if len(files) > 3 else files
    return {
        "title": picture.title,
        "caption": picture.caption,
        "source": svg_uri(picture.figure),
        "command": f"hop report figures {' '.join(f'TRACES/{name}' for name in shown)}",
        "long": picture.name == "ladder",
        "table": beside.get(picture.name, lambda: Markup(""))(),
    }


def _video(name: str, video: Video) -> dict[str, str]:
    source = data_uri(video.content, "image/webp") if video.content else ""
    return {"controller": name, "source": source, "reason": video.reason}
