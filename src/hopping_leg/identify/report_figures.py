"""How well an identified robot follows its recordings: overlays, residual spectra, cost."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import lombscargle

from hopping_leg.arrays import Array
from hopping_leg.figure_style import TORQUE_MAP, WIDTH, colour, styled
from hopping_leg.identify import search, validation
from hopping_leg.robot.parameters import JOINTS

_LABELS = {"position": "position / rad", "torque": "torque / N m"}
_SHOWN = 6.0  # longest stretch that is drawn, s
_SAMPLES = 4000  # residuals that a spectrum takes at most; more change nothing that can be seen
_FREQUENCIES = 500  # frequencies of a spectrum, from slow to half the rate


@styled
def draw_overlay(overlay: validation.Overlay) -> Figure:
    """Draw measured and simulated positions and torques of the stretch that fits worst."""
    rows = worst_stretch(overlay)
    time = overlay.recording.time[rows]
    figure, panels = _panels("time / s")
    for (quantity, joint), axes in panels.items():
        measured = overlay.measured[quantity][rows, joint]
        before, after = overlay.simulated[quantity][:, rows, joint]
        known = ~np.isnan(measured)
        axes.plot(time[known], measured[known], ".", color="0.55", markersize=3.0, label="measured")
        axes.plot(time, before, color=colour(4), linewidth=0.9, label="before")
        axes.plot(time, after, color=colour(0), linewidth=1.1, label="after")
        if known.any():  # what runs away before the fit is outside the picture
            shown = np.concatenate([measured[known], after[np.isfinite(after)]])
            low, high = shown.min(), shown.max()
            room = 0.15 * (high - low) + 1e-6
            axes.set_ylim(low - room, high + 1.6 * room)
        axes.margins(x=0.01)
    panels["position", 0].legend(loc="upper right", ncols=3)
    return figure


def _panels(x_label: str) -> tuple[Figure, dict[tuple[str, int], Axes]]:
    figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    grid, panels = figure.subplots(2, 2, sharex=True, squeeze=False), {}
    for line, (quantity, label) in zip(grid, _LABELS.items(), strict=True):
        for joint, axes in enumerate(line):
            axes.set_ylabel(f"{JOINTS[joint]} {label}")
            panels[quantity, joint] = axes
    for axes in grid[-1]:
        axes.set_xlabel(x_label)
    return figure, panels


def worst_stretch(overlay: validation.Overlay) -> slice:
    """Return the rows of the stretch with the largest position errors after the fit."""
    time = overlay.recording.time
    if time[-1] - time[0] <= _SHOWN:
        return slice(0, len(time))
    error = np.nansum(np.square(overlay.errors("position")[-1]), axis=-1)
    stops = np.searchsorted(time, time + _SHOWN)
    starts = np.flatnonzero(time <= time[-1] - _SHOWN)
    total = np.concatenate([[0.0], np.cumsum(error)])
    first = int(starts[np.argmax(total[stops[starts]] - total[starts])])
    return slice(first, int(stops[first]))


@styled
def draw_spectra(overlays: Sequence[validation.Overlay]) -> Figure:
    """Draw the residuals' amplitude over frequency, before and after the fit."""
    figure, panels = _panels("frequency / Hz")
    for (quantity, joint), axes in panels.items():
        for index, (name, shade) in enumerate((("before", colour(4)), ("after", colour(0)))):
            frequency, amplitude = residual_spectrum(overlays, quantity, joint, index)
            axes.loglog(frequency, amplitude, color=shade, linewidth=1.0, label=name)
    panels["position", 0].legend()
    return figure


def residual_spectrum(
    overlays: Sequence[validation.Overlay], quantity: str, joint: int, hypothesis: int
) -> tuple[Array, Array]:
    """Return frequencies, Hz, and rms amplitudes of residuals over recordings.

    By Lomb and Scargle, as samples are sparse and their times jitter; empty where there is none.
    """
    powers, rate = [], max(o.recording.metadata.rate_hz for o in overlays)
    longest = max(float(o.recording.time[-1] - o.recording.time[0]) for o in overlays)
    frequency = np.geomspace(max(0.2, 2 / longest), rate / 2, _FREQUENCIES)
    for overlay in overlays:
        residual = overlay.errors(quantity)[hypothesis, :, joint]
        known = np.flatnonzero(np.isfinite(residual))[:_SAMPLES]
        if len(known) < 50:
            continue
        values = residual[known] - residual[known].mean()
        time = overlay.recording.time[known]
        powers.append(lombscargle(time, values, 2 * np.pi * frequency) / (len(known) / 4))
    if not powers:
        return np.empty(0), np.empty(0)
    return frequency, np.sqrt(np.maximum(np.mean(powers, axis=0), 1e-24))


@styled
def draw_course(passes: Sequence[search.Pass]) -> Figure:
    """Draw the lowest cost after each round or generation."""
    figure = Figure(figsize=(WIDTH, 2.8), layout="constrained")
    for axes, one in zip(figure.subplots(1, len(passes), squeeze=False)[0], passes, strict=True):
        history = one.found.history
        axes.semilogy(np.arange(1, len(history) + 1), history, ".-", color=colour(0), linewidth=1.0)
        axes.set_title(one.name)
        axes.set_xlabel("round" if one.name.startswith("least") else "generation")
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.set_ylabel("cost")
    return figure


@styled
def draw_correlations(names: Sequence[str], matrix: Array) -> Figure:
    """Draw how the parameters' errors hang together; white is not at all."""
    size = 1.8 + 0.3 * len(names)
    figure = Figure(figsize=(min(WIDTH, size + 1.5), min(WIDTH, size)), layout="constrained")
    axes = figure.subplots()
    shown = axes.imshow(matrix, vmin=-1, vmax=1, cmap=TORQUE_MAP)
    axes.set_xticks(range(len(names)), names, rotation=60, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(len(names)), names)
    axes.grid(visible=False)
    figure.colorbar(shown, ax=axes, shrink=0.8, label="correlation")
    return figure
