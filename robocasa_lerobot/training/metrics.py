"""The numbers that a phase leaves: JSON lines, a picture of the learning curve, and trackers on request."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from accelerate import Accelerator
from accelerate.tracking import get_available_trackers

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import write_text

METRICS, HELD_OUT, CURVE = "metrics.jsonl", "held_out.jsonl", "learning_curve.png"


def append_line(path: Path, line: dict[str, Any]) -> None:
    """Add a line to a file of JSON lines."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")


def read_lines(path: Path) -> list[dict[str, Any]]:
    """The complete lines of a file of JSON lines; none where there is no file."""
    if not path.is_file():
        return []
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("}\n")]


def truncate_metrics(folder: Path, step: int) -> None:
    """Drop the lines of steps that will be done again, and a last line that was cut off."""
    for name in (METRICS, HELD_OUT):
        path = folder / name
        if path.is_file():
            kept = [line for line in read_lines(path) if line["step"] <= step]
            write_text(path, "".join(json.dumps(line) + "\n" for line in kept))


def draw_curve(folder: Path) -> None:
    """Write `learning_curve.png`: the loss against the steps, and the held-out loss of each task where measured."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    lines, held_out = read_lines(folder / METRICS), read_lines(folder / HELD_OUT)
    if not lines:
        return
    figure = Figure(figsize=(7, 4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.plot([line["step"] for line in lines], [line["loss"] for line in lines], label="training", color="black")
    tasks = sorted({task for line in held_out for task in line["tasks"]})
    for task in tasks if len(tasks) <= 10 else []:  # more lines than that cannot be told apart
        points = [(line["step"], line["tasks"][task]) for line in held_out if task in line["tasks"]]
        axes.plot(*zip(*points, strict=True), marker=".", linewidth=1, label=f"held out: {task}")
    if held_out:
        mean = [line["loss"] for line in held_out]
        axes.plot([line["step"] for line in held_out], mean, "--", color="grey", label="held out: mean of tasks")
    if all(line["loss"] > 0 for line in [*lines, *held_out]):
        axes.set_yscale("log")
    axes.set(xlabel="optimiser steps", ylabel="loss", title=folder.name)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    aside = folder / f".{CURVE}"
    figure.savefig(aside, format="png", dpi=120)
    aside.replace(folder / CURVE)


def check_trackers(names: Sequence[str]) -> None:
    """Check that the packages of the trackers are there.

    Raises:
        UserError: one is not.
    """
    available = {str(tracker.value) for tracker in get_available_trackers()}
    for name in names:
        if name not in available:
            raise UserError(
                f"tracker {name!r}: its package is not installed. Install it with `{sys.executable} -m pip install "
                f"{name}`, or take it out of `trackers`; {METRICS} and {CURVE} are always written."
            )


def start_trackers(accelerator: Accelerator, name: str, settings: dict[str, Any]) -> None:
    """Begin a run named `name` in every tracker that the accelerator was made with.

    Raises:
        UserError: one cannot begin: it knows no account, or does not reach its server.
    """
    if not accelerator.log_with:
        return
    plain = {k: v if isinstance(v, int | float | str | bool) else json.dumps(v) for k, v in settings.items()}
    try:
        accelerator.init_trackers(name, config=plain)
    except Exception as error:  # each package has its own
        names = ", ".join(str(getattr(tracker, "value", tracker)) for tracker in accelerator.log_with)
        raise UserError(
            f"the trackers cannot begin ({names}): {error} Log in first (`wandb login`; `WANDB_MODE=offline` needs no "
            f"account), or leave `trackers` out: {METRICS} and {CURVE} are always written."
        ) from error


def track(accelerator: Accelerator, phase: str, line: dict[str, Any], earlier_steps: int) -> None:
    """Send a line of metrics to the trackers, each number under the phase's name, its `step` among them.

    The trackers' own steps go on from phase to phase (`earlier_steps` are those of the phases before): wandb drops
    what comes with a smaller step than it has had.
    """
    if accelerator.log_with:
        values = {f"{phase}/{key}": value for key, value in line.items() if isinstance(value, int | float)}
        values |= {f"{phase}/held_out/{task}": value for task, value in line.get("tasks", {}).items()}
        accelerator.log(values, step=earlier_steps + line["step"])
