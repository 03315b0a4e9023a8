"""Figures of a study, as SVG: rates with their intervals, and losses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from robocasa_lerobot.files import written_aside
from robocasa_lerobot.study.stored import StoredRun
from robocasa_lerobot.study.tables import CellRate

_ROW_INCHES, _WIDTH_INCHES = 0.32, 7.0


def draw_rates(rates: Mapping[str, CellRate], path: Path) -> None:
    """A bar for each row with its interval, and a point for each training."""
    figure, axes = _figure(1.0 + _ROW_INCHES * max(1, len(rates)))
    for place, found in enumerate(rates.values()):
        rate = found.rate
        error = [[100 * (rate.value - rate.low)], [100 * (rate.high - rate.value)]]
        axes.barh(place, 100 * rate.value, height=0.6, color="#8fb8de", xerr=error, ecolor="#333333", capsize=3)
        axes.plot([100 * one for one in found.seeds], [place] * len(found.seeds), ".", color="#b4442e", markersize=5)
    axes.set_yticks(range(len(rates)), list(rates))
    axes.invert_yaxis()
    axes.set(xlim=(0, 100), xlabel="success rate, %")
    axes.grid(axis="x", alpha=0.3)
    _save(figure, path)


def draw_curves(runs: Iterable[StoredRun], path: Path) -> None:
    """The training loss of each phase of each run, against its steps; one colour for each experiment and phase."""
    figure, axes = _figure(3.6)
    colours: dict[str, str] = {}
    for run in runs:
        for phase in run.phases:
            points = [(step, loss) for name, step, loss in run.curves if name == phase]
            label = f"{run.experiment}, {phase}"
            first = label not in colours
            colour = colours.setdefault(label, f"C{len(colours) % 10}")
            axes.plot(*zip(*points, strict=True), linewidth=1, color=colour, label=label if first else None)
    axes.set(xlabel="optimiser steps", ylabel="training loss", yscale="log")
    axes.grid(alpha=0.3)
    if colours:
        axes.legend(fontsize="x-small", ncols=2)
    _save(figure, path)


def _figure(height_inches: float) -> tuple[Any, Any]:
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH_INCHES, height_inches), layout="constrained")
    FigureCanvasSVG(figure)
    return figure, figure.subplots()


def _save(figure: Any, path: Path) -> None:
    """The same figure gives the same bytes: without a date, and with names that follow from what is drawn."""
    import matplotlib as mpl

    path.parent.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({"svg.hashsalt": "robocasa_lerobot"}), written_aside(path) as aside:
        figure.savefig(aside, format="svg", metadata={"Date": None})
