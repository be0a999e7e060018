"""The report: figures of an evaluation, and one HTML page that holds all and needs nothing."""

import os
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

from markupsafe import Markup
from matplotlib.figure import Figure

from hopping_leg.evaluate import acceptance, figures, metrics, result, runner, tables, trials
from hopping_leg.evaluate.video import Video, fixed_traces, render_video
from hopping_leg.html_page import data_uri, page_template, svg_uri, table
from hopping_leg.robot.parameters import Robot


@dataclass(frozen=True)
class Picture:
    """One figure of a report."""

    name: str
    """Short and unique, fit for a file name."""
    title: str
    caption: str
    figure: Figure
    files: tuple[str, ...]
    """Names of the traces it is drawn from."""


_HEIGHTS = {
    "sequence": (
        "All commands in turn",
        "Base height in the trial that commands each height for 5 s, as in the paper's Fig. 8."
        " Dots: apexes with the foot off the ground; thick lines: their median where they count.",
    ),
    "staircase": (
        "Staircase",
        "Base height while the command rises by 0.02 m (for this leg's size) every 5 s, as in the"
        " paper's Fig. 5.",
    ),
    "heights": (
        "Heights over time",
        "Base height over time. Dots: apexes with the foot off the ground.",
    ),
}


def draw_report_figures(evaluation: result.Evaluation, runs: Sequence[trials.Run]) -> list[Picture]:
    """Draw every figure that the runs allow."""
    return list(_figures(evaluation, runs))


def _figures(evaluation: result.Evaluation, runs: Sequence[trials.Run]) -> Iterator[Picture]:
    def files(*kinds: str) -> tuple[str, ...]:
        return tuple(run.file_name for run in runs if run.trial.kind in kinds)

    examples = _examples(runs)
    shown = {
        kind: _first_of_each(run for run in runs if run.trial.kind == kind)
        for kind in ("sequence", "staircase")
    }
    for kind, found in shown.items() if any(shown.values()) else [("heights", examples)]:
        if found:
            figure = figures.draw_heights({run.controller: run.trace for run in found})
            yield Picture(kind, *_HEIGHTS[kind], figure, tuple(run.file_name for run in found))
    if any(row.hops for row in evaluation.summary):
        yield Picture(
            "distributions",
            "Distributions of the apex",
            "Every hop of the fixed trials and the sequence, pooled as in the paper's Fig. 9."
            " Coloured lines: medians; grey lines: commands.",
            figures.draw_distributions(evaluation),
            files("fixed", "sequence"),
        )
    if evaluation.ladder:
        caption = "Commands between and beyond the trained ones, 15 s each."
        figure = figures.draw_ladder(evaluation)
        yield Picture("ladder", "Ladder of commands", caption, figure, files("ladder"))
    for run in examples:
        about = f"{run.controller}, command {run.trial.steps[0][0]:.2f} m"
        safe = run.file_name.removesuffix(".parquet")
        yield Picture(
            f"phase-space-{safe}",
            f"Knee torque in phase space: {run.controller}",
            "Torque asked of the knee at every configuration met in 10 s, as in the paper's Fig. 6."
            " Line: one phase from its start (circle) to its end (diamond).",
            figures.draw_phase_space(run.trace, about),
            (run.file_name,),
        )
        if metrics.has_estimate(run.trace):
            yield Picture(
                f"estimate-{safe}",
                f"Estimated height: {run.controller}",
                "Height as the controller estimates it from its joints, beside the true height.",
                figures.draw_estimate(run.trace, about),
                (run.file_name,),
            )


def _examples(runs: Sequence[trials.Run]) -> list[trials.Run]:
    """Return one fixed run per controller: the middle command, the first repeat."""
    fixed = [run for run in runs if len(run.trial.steps) == 1]
    examples = []
    for name in dict.fromkeys(run.controller for run in fixed):
        own = [run for run in fixed if run.controller == name]
        preferred = [run for run in own if run.trial.kind == "fixed"] or own
        commands = sorted({run.trial.steps[0][0] for run in preferred})
        middle = commands[len(commands) // 2]
        examples += _first_of_each(r for r in preferred if r.trial.steps[0][0] == middle)
    return examples


def _first_of_each(runs: Iterable[trials.Run]) -> list[trials.Run]:
    """Return the first repeat of every controller."""
    first: dict[str, trials.Run] = {}
    for run in runs:
        if run.repeat < first.setdefault(run.controller, run).repeat:
            first[run.controller] = run
    return list(first.values())


def write_report(judged: runner.EvaluationRun, videos: dict[str, Video] | None = None) -> bytes:
    """Return the report as HTML, with the video of each controller if there are some."""
    evaluation, secondary = judged.evaluation, judged.evaluation.secondary
    page = page_template("hopping_leg.evaluate", "report.html.j2").render(
        title=f"Hopping leg: {', '.join(evaluation.controllers)}",
        subtitle=_subtitle(evaluation.conditions),
        evaluation=evaluation,
        tables={
            "summary": table(tables.SUMMARY, evaluation.summary),
            "load": table(tables.LOAD, evaluation.summary),
            "groups": table(tables.GROUPS, evaluation.groups),
            "secondary": table(tables.SUMMARY, secondary.summary if secondary else []),
            "estimators": tables.estimator_table(evaluation.estimators),
        },
        acceptance=acceptance.acceptance_lines(map(asdict, evaluation.summary)),
        pictures=pictures_of(evaluation, judged.runs),
        videos=[
            {
                "controller": name,
                "source": data_uri(video.content, "image/webp") if video.content else "",
                "reason": video.reason,
            }
            for name, video in (videos or {}).items()
        ],
        conditions=result.flat_conditions({**evaluation.conditions, **evaluation.versions}),
    )
    return page.encode()


def render_videos(judged: runner.EvaluationRun, robot: Robot) -> dict[str, Video]:
    """Render one video per controller; after a first failure the rest are not tried."""
    names = judged.evaluation.controllers
    videos = dict.fromkeys(names, Video(None, "it was not asked for"))
    hopped = {name: traces for name in names if (traces := fixed_traces(judged.runs, name))}
    if not hopped:
        return videos
    (first, traces), *others = hopped.items()
    videos[first] = render_video(robot, traces)
    if videos[first].content is None:
        return videos | dict.fromkeys(hopped, videos[first])
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        rendered = pool.map(lambda one: render_video(robot, one[1]), others)
        return videos | dict(zip([name for name, _ in others], rendered, strict=True))


def _subtitle(c: dict[str, Any]) -> str:
    noisy = any(c["disturbance"][k] for k in ("joint_noise", "torque_noise", "delay_probability"))
    return (
        f"{c['robot']} on its {c['floor']} floor, {c['rate_hz']:g} Hz control,"
        f" {1e3 * c['timestep_s']:g} ms physics, {c['seeds']} seed{'' if c['seeds'] == 1 else 's'},"
        f" {'sensor noise, torque noise and delay on' if noisy else 'no noise, no delay'}"
    )


def pictures_of(evaluation: result.Evaluation, runs: Sequence[trials.Run]) -> list[dict[str, Any]]:
    """Return what a page shows of every figure: its texts, source, command and table."""
    beside = {
        "distributions": lambda: tables.neighbour_table(evaluation.neighbours),
        "staircase": lambda: tables.staircase_table(evaluation.staircase),
        "ladder": lambda: table(tables.LADDER, evaluation.ladder),
    }

    def command(files: tuple[str, ...]) -> str:
        shown = files if len(files) <= 3 else (*files[:2], "...")
        return f"hop report figures {' '.join(f'TRACES/{name}' for name in shown)}"

    return [
        {
            "name": picture.name,
            "title": picture.title,
            "caption": picture.caption,
            "source": svg_uri(picture.figure),
            "command": command(picture.files),
            "table": beside.get(picture.name, lambda: Markup(""))(),
        }
        for picture in draw_report_figures(evaluation, runs)
    ]
