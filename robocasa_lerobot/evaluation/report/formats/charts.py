"""Charts as inline SVG that takes its colours and font from the page, so that they follow dark and light."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.evaluation.report.training import TrainingPhase

MAX_POINTS = 300
# Colours that matplotlib writes and that are exchanged for the page's own afterwards.
_INK, _MUTED = "#010203", "#040506"
_SERIES = tuple(f"#0a0b{number:02x}" for number in range(8))
_PAGE_COLOURS = {
    _INK: "var(--ink)",
    _MUTED: "var(--rule)",
    **{written: f"var(--series-{number + 1})" for number, written in enumerate(_SERIES)},
}
# Lines differ in dash and marker too, for those who do not tell the colours apart.
_DASHES = ("-", (0, (6, 2)), (0, (2, 1.5)), (0, (7, 2, 1.5, 2)), "-", (0, (6, 2)), (0, (2, 1.5)), (0, (7, 2, 1.5, 2)))
_MARKERS = ("o", "s", "D", "^", "v", "P", "X", "h")
SERIES = len(_SERIES)


@dataclass(frozen=True)
class Line:
    """A line of a chart: `series` is its place in the palette, `low` and `high` its interval at each point."""

    label: str
    series: int
    x: tuple[float, ...]
    y: tuple[float, ...]
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    errorbars: bool = False


@dataclass(frozen=True)
class Bars:
    """A series of a bar chart: `series` is its place in the palette."""

    label: str
    series: int
    heights: tuple[float, ...]


def line_chart(
    name: str,
    title: str,
    description: str,
    lines: Sequence[Line],
    x_label: str,
    y_label: str,
    x_scale: str = "linear",
    y_range: tuple[float, float] | None = None,
) -> str:
    """Lines with intervals; a point chart with whiskers where `errorbars` is set.

    Args:
        name: unique on the page, for ids.
        title: read first by screen readers.
        description: what the chart shows, for those who do not see it.
        lines: what to draw.
        x_label: with unit.
        y_label: with unit.
        x_scale: "linear", or "symlog" for counts that include 0.
        y_range: ends of the vertical axis; default: from the data.
    """
    figure, axes = _axes(name, (4.4, 3.0))
    for line in lines:
        colour, dash = _SERIES[line.series % SERIES], _DASHES[line.series % SERIES]
        if line.errorbars:
            y = np.array(line.y)
            spread = np.clip([y - np.array(line.low), np.array(line.high) - y], 0, None)
            marker = _MARKERS[line.series % SERIES]
            axes.errorbar(
                line.x, y, spread, color=colour, linestyle=dash, marker=marker, markersize=5.5, linewidth=1.8, capsize=3
            )
        else:
            if line.low:
                axes.fill_between(line.x, line.low, line.high, color=colour, alpha=0.16, linewidth=0)
            axes.plot(line.x, line.y, color=colour, linestyle=dash, linewidth=1.9)
    if x_scale == "symlog":
        points = sorted({x for line in lines for x in line.x})
        axes.set_xscale("symlog", linthresh=min([x for x in points if x > 0], default=1) / 2)
        axes.set_xticks(points, [f"{x:g}" for x in points])
        axes.set_xticks([], minor=True)
        axes.set_xlim(-0.06 * min([x for x in points if x > 0], default=1), points[-1] * 1.3)
    else:
        axes.set_xlim(left=0)
    if y_range is not None:
        top = max(max(line.high or line.y) for line in lines)
        # The whole range up to 100 %, unless everything lies in its lowest part.
        axes.set_ylim(y_range[0], y_range[1] if top > y_range[1] / 3 else max(1.0, 1.4 * top))
    axes.set_xlabel(x_label, color=_INK)
    axes.set_ylabel(y_label, color=_INK)
    return _svg(figure, name, title, description)


def bar_chart(
    name: str,
    title: str,
    description: str,
    labels: Sequence[str],
    bars: Sequence[Bars],
    x_label: str,
    y_label: str,
) -> str:
    """Bars side by side at each label; the arguments are those of `line_chart`."""
    figure, axes = _axes(name, (4.4, 3.0))
    places, width = np.arange(len(labels)), 0.84 / max(1, len(bars))
    for number, one in enumerate(bars):
        left = places + (number - (len(bars) - 1) / 2) * width
        axes.bar(left, one.heights, width, color=_SERIES[one.series % SERIES], linewidth=0)
    axes.set_xticks(places, labels, rotation=45 if max(map(len, labels), default=0) > 3 else 0)
    axes.grid(False, axis="x")
    axes.set_xlabel(x_label, color=_INK)
    axes.set_ylabel(y_label, color=_INK)
    return _svg(figure, name, title, description)


def learning_curve(phase: TrainingPhase, name: str = "learning-curve") -> str:
    """The loss of a phase against its steps, on a logarithmic axis: raw values thin, their running mean thick."""
    figure, axes = _axes(name, (4.4, 2.6))
    steps, losses = thin_out(phase.steps, phase.losses)
    marker = "o" if len(steps) == 1 else ""
    if len(steps) > 20:
        axes.plot(steps, losses, color=_SERIES[0], alpha=0.35, linewidth=0.8)
        losses = running_mean(losses, max(3, len(losses) // 20))
    axes.plot(steps, losses, color=_SERIES[0], linewidth=1.8, marker=marker)
    if len(losses) and losses.min() > 0 and losses.max() / losses.min() > 5:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        # Minor labels (2, 3, 5 of a decade) only where one decade or less is shown; else they crowd.
        wide = losses.max() / losses.min() > 30
        axes.yaxis.set_minor_formatter("" if wide else lambda x, _: f"{x:g}" if f"{x:e}"[0] in "235" else "")
    axes.set_xlabel("step", color=_INK)
    axes.set_ylabel("loss", color=_INK)
    title = f"Loss of phase {phase.name} against training steps"
    last = f"; the last value is {phase.losses[-1]:.4g} at step {phase.steps[-1]:,}" if phase.losses else ""
    return _svg(figure, name, title, f"{title}{last}.")


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


def _style(name: str) -> dict[str, Any]:
    # Ids of clip paths are hashed from this salt; two charts on one page must not share them.
    return {"svg.fonttype": "none", "svg.hashsalt": name, "font.family": "sans-serif", "font.size": 9.5}


def _axes(name: str, inches: tuple[float, float]) -> tuple[Any, Any]:
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    with mpl.rc_context(_style(name)):
        figure = Figure(figsize=inches, layout="constrained")
        FigureCanvasSVG(figure)
        axes = figure.add_subplot()
    axes.tick_params(colors=_INK, which="both", length=0)
    axes.grid(True, color=_MUTED, linewidth=0.6)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side == "bottom")
        spine.set_color(_MUTED)
    return figure, axes


def _svg(figure: Any, name: str, title: str, description: str) -> str:
    import matplotlib as mpl

    buffer = io.StringIO()
    with mpl.rc_context(_style(name)):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    return for_page(buffer.getvalue(), name, title, description)


def for_page(svg: str, name: str, title: str, description: str) -> str:
    """The `<svg>` element alone, scalable, titled and described for screen readers, in the page's colours and font."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    # Names of elements repeat from chart to chart; only elements that are referred to keep one, made unique.
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', svg))
    svg = re.sub(r' id="([^"]+)"', lambda match: f' id="{name}-{match[1]}"' if match[1] in used else "", svg)
    svg = re.sub(r'(url\(#|href="#)([^)"]+)', lambda match: f"{match[1]}{name}-{match[2]}", svg)
    start, rest = svg.split(">", 1)
    start += f' role="img" aria-labelledby="{name}-title {name}-desc"'
    text = (
        f'<title id="{name}-title">{html.escape(title)}</title><desc id="{name}-desc">{html.escape(description)}</desc>'
    )
    svg = f"{start}>{text}{rest}"
    svg = re.sub(r"font-family: [^;\"]*", "font-family: var(--sans)", svg)
    svg = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font: \1 var(--sans)", svg)  # of older matplotlib
    for written, page in _PAGE_COLOURS.items():
        svg = svg.replace(written, page)
    return svg.strip()
