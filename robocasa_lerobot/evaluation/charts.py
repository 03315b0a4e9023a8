"""Learning curves as inline SVG that takes its colours from the page, so that they follow dark and light."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.evaluation.report_data import TrainingPhase

MAX_POINTS = 300
# Colours that matplotlib writes and that are exchanged for the page's own afterwards.
_INK, _MUTED, _LINE = "#010203", "#040506", "#070809"
_PAGE_COLOURS = {_INK: "var(--ink)", _MUTED: "var(--rule)", _LINE: "var(--accent)"}


def learning_curve(phase: TrainingPhase) -> str:
    """The loss of a phase against its steps, on a logarithmic axis: raw values thin, their running mean thick."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    # Ids of clip paths are hashed from this salt; two charts on one page must not share them.
    style = {"svg.fonttype": "none", "svg.hashsalt": phase.name, "font.family": "sans-serif", "font.size": 9}
    with mpl.rc_context(style):
        figure = Figure(figsize=(4.6, 2.5), layout="constrained")
        FigureCanvasSVG(figure)
        axes = figure.add_subplot()
        steps, losses = thin_out(phase.steps, phase.losses)
        marker = "o" if len(steps) == 1 else ""
        if len(steps) > 20:
            axes.plot(steps, losses, color=_LINE, alpha=0.3, linewidth=0.8)
            losses = running_mean(losses, max(3, len(losses) // 20))
        axes.plot(steps, losses, color=_LINE, linewidth=1.8, marker=marker)
        if len(losses) and losses.min() > 0 and losses.max() / losses.min() > 5:
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter("{x:g}")
            # Minor labels (2, 3, 5 of a decade) only where one decade or less is shown; else they crowd.
            wide = losses.max() / losses.min() > 30
            axes.yaxis.set_minor_formatter("" if wide else lambda x, _: f"{x:g}" if f"{x:e}"[0] in "235" else "")
        axes.set_xlabel("step", color=_INK)
        axes.set_ylabel("loss", color=_INK)
        axes.tick_params(colors=_INK, which="both", length=0)
        axes.grid(True, color=_MUTED, linewidth=0.6)
        axes.set_axisbelow(True)
        for side, spine in axes.spines.items():
            spine.set_visible(side == "bottom")
            spine.set_color(_MUTED)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return for_page(buffer.getvalue(), f"Loss of phase {phase.name} against training steps")


def thin_out(steps: Sequence[int], losses: Sequence[float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """At most MAX_POINTS points: means over equal runs of neighbours, so that no spike is picked or lost by chance."""
    size = max(1, -(-len(steps) // MAX_POINTS))
    starts = range(0, len(steps), size)
    x = np.array([np.mean(steps[start : start + size]) for start in starts], dtype=np.float64)
    y = np.array([np.mean(losses[start : start + size]) for start in starts], dtype=np.float64)
    return x, y


def running_mean(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Centred running mean over `width` values, over fewer at the ends."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    index = np.arange(len(values))
    low, high = np.maximum(index - width // 2, 0), np.minimum(index + width // 2 + 1, len(values))
    mean: NDArray[np.float64] = (sums[high] - sums[low]) / (high - low)
    return mean


def for_page(svg: str, label: str) -> str:
    """The `<svg>` element alone, scalable, labelled for screen readers, in the page's colours and font."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    svg = svg.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1)
    svg = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font: \1 var(--sans)", svg)
    for written, page in _PAGE_COLOURS.items():
        svg = svg.replace(written, page)
    return svg.strip()
