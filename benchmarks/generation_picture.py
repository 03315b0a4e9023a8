"""A picture of what attempts at generated demonstrations come to: a line for each task, a mark for each arm."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

# Colours are those of Okabe and Ito, which people who see few colours can tell apart.
_MARKS = {
    "ours": ("o", "#0072B2", "generated"),
    "mimicgen": ("x", "#D55E00", "MimicGen's way"),
    "scripted": ("|", "0.35", "the demonstrator itself"),
    "far": ("^", "#009E73", "from afar, at any heading"),
    "one": ("s", "#CC79A7", "of one source"),
    "own": ("D", "#E69F00", "in the sources' own scenes"),
}
_SPREAD = 0.32  # of a line's height: so far apart are the marks of the first arm and of the last one


def draw(arms: Mapping[str, Any], path: Path) -> None:
    """Write the rates of every task, those that the first arm does best on top; its intervals are Wilson's 95 %.

    Args:
        arms: summaries of `generation_report.summary`, by arm.
        path: of the picture.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    first = next(iter(arms))
    tasks = {name: row for summary in arms.values() for name, row in summary["tasks"].items()}
    rates = {name: arms[first]["tasks"].get(name, {"rate": -1.0})["rate"] for name in tasks}
    order = sorted(tasks, key=lambda name: (rates[name], name))
    figure = Figure(figsize=(9, 1.6 + 0.19 * len(order)), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for place, (arm, summary) in enumerate(arms.items()):
        marker, colour, label = _MARKS[arm]
        shift = _SPREAD * (0.5 - place / max(len(arms) - 1, 1))
        rows = [(y + shift, summary["tasks"][name]) for y, name in enumerate(order) if name in summary["tasks"]]
        heights, found = [y for y, _ in rows], [row["rate"] for _, row in rows]
        if arm == first:
            spread = [
                [row["rate"] - row["wilson_95"][0] for _, row in rows],
                [row["wilson_95"][1] - row["rate"] for _, row in rows],
            ]
            axes.errorbar(found, heights, xerr=spread, fmt="none", lw=1.0, color=colour, zorder=1)
        axes.scatter(
            found,
            heights,
            s=36 if marker == "|" else 16,
            marker=marker,
            color=colour,
            label=f"{label}: {summary['mean']:.0%}",
        )
    axes.set_yticks(range(len(order)), order, fontsize=7)
    axes.set_ylim(-0.7, len(order) - 0.3)
    axes.set_xlim(-0.01, 1.01)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    axes.grid(axis="both", color="0.93")
    axes.set_axisbelow(True)
    axes.set_xlabel("kept of all attempts, in kitchens that no source is from")
    figure.legend(loc="outside upper center", ncols=3, fontsize=8, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
