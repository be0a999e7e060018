"""The report: figures of an evaluation, and one HTML page that holds all and needs nothing."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from statistics import median
from typing import Any

from markupsafe import Markup
from matplotlib.figure import Figure

from hopping_leg.colours import controller_colours
from hopping_leg.evaluate import figures, metrics, result, runner, tables, trials
from hopping_leg.evaluate.video import Video, fixed_traces, render_hops
from hopping_leg.html_page import data_uri, page_template, svg_uri, table
from hopping_leg.robot.parameters import Robot
from hopping_leg.trace import Trace


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


_KINDS = ("staircase", "sequence")
_TITLES = {
    "staircase": "Staircase",
    "sequence": "All commands in turn",
    "heights": "Heights over time",
}
_CAPTIONS = {
    "staircase": "Base height while the command rises by 0.02 m (for this leg's size) every 5 s, as"
    " in the paper's Fig. 5.",
    "sequence": "Base height in the trial that commands each height for 5 s, as in the paper's"
    " Fig. 8.",
    "heights": "Base height over time.",
}


def draw_report_figures(evaluation: result.Evaluation, runs: Sequence[trials.Run]) -> list[Picture]:
    """Draw every figure that the runs allow; the first says most."""
    return list(_figures(evaluation, runs))


def _figures(evaluation: result.Evaluation, runs: Sequence[trials.Run]) -> Iterator[Picture]:
    def files(*kinds: str) -> tuple[str, ...]:
        return tuple(run.file_name for run in runs if run.trial.kind in kinds)

    order = evaluation.controllers
    runs = sorted(
        runs, key=lambda run: order.index(run.controller) if run.controller in order else 0
    )
    examples = _examples(runs)
    shown = {kind: _first_of_each(run for run in runs if run.trial.kind == kind) for kind in _KINDS}
    shown = {kind: found for kind, found in shown.items() if found}
    for kind, found in list(shown.items())[:1]:
        yield _picture(
            "apexes",
            f"Apexes, {_TITLES[kind].lower()}",
            "Apexes with the foot off the ground, first seed. The command is what they aim at.",
            figures.draw_apexes,
            found,
        )
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
    for kind, found in shown.items() or [("heights", examples)]:
        if found:
            caption = f"{_CAPTIONS[kind]} Dots: apexes in flight; black: their median."
            yield _picture(kind, _TITLES[kind], caption, figures.draw_heights, found)
    if examples:
        command = f"Command {examples[0].trial.steps[0][0]:.2f} m."
        yield _picture(
            "phase-space",
            "Knee torque in phase space",
            f"{command} Torque asked of the knee at every configuration met in 10 s, as in the"
            " paper's Fig. 6. Line: one phase from its start (circle) to its end (diamond).",
            figures.draw_phase_space,
            examples,
        )
    if estimated := [run for run in examples if metrics.has_estimate(run.trace)]:
        caption = (
            f"{command} Height as controllers estimate it from their joints, and the true one."
        )
        yield _picture("estimate", "Estimated height", caption, figures.draw_estimate, estimated)


def _picture(
    name: str,
    title: str,
    caption: str,
    draw: Callable[[dict[str, Trace]], Figure],
    runs: Sequence[trials.Run],
) -> Picture:
    figure = draw({run.controller: run.trace for run in runs})
    return Picture(name, title, caption, figure, tuple(run.file_name for run in runs))


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
    shown = pictures_of(evaluation, judged.runs)
    page = page_template("hopping_leg.evaluate", "report.html.j2").render(
        title=f"Hopping leg: {', '.join(evaluation.controllers)}",
        subtitle=_subtitle(evaluation.conditions),
        evaluation=evaluation,
        verdicts=verdicts(evaluation),
        tables={
            "summary": table(tables.SUMMARY, evaluation.summary),
            "load": table(tables.LOAD, evaluation.summary),
            "joints": table(tables.JOINTS, evaluation.summary),
            "groups": table(tables.GROUPS, evaluation.groups),
            "secondary": table(tables.SUMMARY, secondary.summary if secondary else []),
            "estimators": tables.estimator_table(evaluation.estimators),
        },
        lead=shown[:1],
        pictures=shown[1:],
        sinks=_sinks(evaluation),
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


def verdicts(evaluation: result.Evaluation) -> list[dict[str, str]]:
    """Return what a page says first: each controller, its colour and the verdict on it."""
    return [
        {"controller": name, "colour": paint, "text": verdict(evaluation, name)}
        for name, paint in controller_colours(evaluation.controllers).items()
    ]


def verdict(evaluation: result.Evaluation, controller: str) -> str:
    """Return how near it hops to its commands, what it skips and touches, and on another floor.

    Heights between and beyond the commands count, too.
    """
    rows = evaluation.rows(controller)
    rows += [row for row in evaluation.ladder if row.controller == controller]
    errors = {row: abs(row.median_error_m) for row in rows if row.hops}
    if not errors:
        return "does not hop at any height."
    worst = max(errors, key=errors.__getitem__)
    parts = [
        f"misses its command by {_mm(median(errors.values()))} in the median of"
        f" {len({row.command_m for row in rows})} heights and by {_mm(errors[worst])} at the worst,"
        f" {worst.command_m:.2f} m"
    ]
    if still := sorted({row.command_m for row in rows} - {row.command_m for row in errors}):
        parts.append(f"does not hop at {', '.join(f'{command:.2f}' for command in still)} m")
    parts += [_skipped(rows), _contacts(sum(row.body_contacts for row in rows))]
    other = evaluation.secondary
    if other is not None and (there := [r for r in other.rows(controller) if r.hops]):
        most = max(abs(row.median_error_m) for row in there)
        parts.append(f"on the {other.conditions['floor']} floor misses by {_mm(most)} at the worst")
    return f"{'; '.join(parts)}."


def _skipped(rows: Sequence[result.Summary]) -> str:
    skipped, hops = (sum(getattr(r, name) for r in rows) for name in ("skipped_hops", "hops"))
    return f"skips {skipped} of {skipped + hops} hops" if skipped else "skips no hop"


def _contacts(count: int) -> str:
    times = "once" if count == 1 else f"{count} times"
    return f"base or knee touch the ground {times}" if count else "only the foot touches the ground"


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.1f} mm"


def _sinks(evaluation: result.Evaluation) -> str:
    """Return how deep feet sink into the ground, as each controller's deepest."""
    deepest = {
        name: max(row.max_sink_m for row in evaluation.rows(name))
        for name in evaluation.controllers
    }
    return ", ".join(f"{1e3 * sink:.0f} mm ({name})" for name, sink in deepest.items())


def render_videos(judged: runner.EvaluationRun, robot: Robot) -> dict[str, Video]:
    """Render one video per controller; after a first failure the rest are not tried."""
    colours = controller_colours(judged.evaluation.controllers)
    videos = dict.fromkeys(colours, Video(None, "it was not asked for"))
    hopped = {name: traces for name in colours if (traces := fixed_traces(judged.runs, name))}

    def render(name: str) -> Video:
        return render_hops(robot, name, colours[name], hopped[name])

    if not hopped:
        return videos
    first, *others = hopped
    videos[first] = render(first)
    if videos[first].content is None:
        return videos | dict.fromkeys(hopped, videos[first])
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return videos | dict(zip(others, pool.map(render, others), strict=True))


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
        return f"hop report {' '.join(f'TRACES/{name}' for name in shown)}"

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
