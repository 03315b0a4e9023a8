"""Figures of a study, as SVG: rates with their intervals, what is kept after each phase, and losses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot.evaluation.statistics.lifelong import Lifelong
from robocasa_lerobot.files import written_aside
from robocasa_lerobot.study.stored import StoredRun
from robocasa_lerobot.study.tables import CellRate

_ROW_INCHES, _WIDTH_INCHES = 0.32, 7.0
_COLOURS = 10  # of matplotlib's usual ones
_MAPS_IN_ROW, _PALE = 2, 0.65  # of maps beside each other; of the rate from which on numbers are white
_STYLES = ("-", "--", ":", "-.")  # one after the other, where colours come again


def draw_rates(rates: Mapping[str, CellRate], task_set: str, path: Path) -> None:
    """A bar for each row with its interval, and a point for each training: the rates at the tasks of a set."""
    figure, axes = _figure(1.0 + _ROW_INCHES * max(1, len(rates)))
    for place, found in enumerate(rates.values()):
        rate = found.rate
        error = [[100 * (rate.value - rate.low)], [100 * (rate.high - rate.value)]]
        axes.barh(place, 100 * rate.value, height=0.6, color="#8fb8de", xerr=error, ecolor="#333333", capsize=3)
        axes.plot([100 * one for one in found.seeds], [place] * len(found.seeds), ".", color="#b4442e", markersize=5)
    axes.set_yticks(range(len(rates)), list(rates))
    axes.invert_yaxis()
    axes.set(xlim=(0, 100), xlabel=f"success rate at {task_set}, %")
    axes.grid(axis="x", alpha=0.3)
    _save(figure, path)


def draw_matrices(found: Mapping[str, Lifelong], count: int, path: Path) -> None:
    """A map for each variant: the rates at the tasks of each of `count` phases (across) after each phase (down)."""
    rows = -(-len(found) // _MAPS_IN_ROW)
    figure, maps = _figure(0.4 + (0.9 + 0.5 * count) * rows, rows, _MAPS_IN_ROW)
    for axes, (name, summary) in zip(maps.flat, found.items(), strict=False):
        rates = np.full((count, count), np.nan)
        for after, row in summary.matrix.items():
            for tasks, rate in row.items():
                rates[after - 1, tasks - 1] = rate.value
                colour = "white" if rate.value > _PALE else "black"
                text = f"{100 * rate.value:.0f} %"
                axes.text(tasks - 1, after - 1, text, ha="center", va="center", fontsize="small", color=colour)
        axes.imshow(rates, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        axes.set_title(name, fontsize="medium")
        axes.set_xticks(range(count), [str(number) for number in range(1, count + 1)], fontsize="small")
        axes.set_xlabel("tasks of phase", fontsize="small")
        axes.set_yticks(range(count), [f"after phase {number}" for number in range(1, count + 1)], fontsize="small")
    for axes in maps.flat[len(found) :]:
        axes.set_axis_off()
    _save(figure, path)


def draw_curves(runs: Iterable[StoredRun], path: Path) -> None:
    """The training loss of each phase of each run, against its steps; one line for each experiment and phase."""
    figure, axes = _figure(3.6)
    numbers: dict[str, int] = {}
    for run in runs:
        for phase in run.phases:
            points = [(step, loss) for name, step, loss in run.curves if name == phase]
            label = f"{run.experiment}, {phase}"
            first = label not in numbers
            number = numbers.setdefault(label, len(numbers))
            axes.plot(
                *zip(*points, strict=True),
                linewidth=1,
                color=f"C{number % _COLOURS}",
                linestyle=_STYLES[number // _COLOURS % len(_STYLES)],
                label=label if first else None,
            )
    axes.set(xlabel="optimiser steps", ylabel="training loss", yscale="log")
    axes.grid(alpha=0.3)
    if numbers:
        axes.legend(fontsize="x-small", ncols=2)
    _save(figure, path)


def _figure(height_inches: float, rows: int = 1, columns: int = 1) -> tuple[Any, Any]:
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH_INCHES, height_inches), layout="constrained")
    FigureCanvasSVG(figure)
    return figure, figure.subplots(rows, columns)


def _save(figure: Any, path: Path) -> None:
    """The same figure gives the same bytes: without a date, and with names that follow from what is drawn."""
    import matplotlib as mpl

    path.parent.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({"svg.hashsalt": "robocasa_lerobot"}), written_aside(path) as aside:
        figure.savefig(aside, format="svg", metadata={"Date": None})
