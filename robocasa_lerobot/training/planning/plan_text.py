"""A plan as text: the graph first, then the missing data, then the sums."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from robocasa_lerobot.training.config.experiment import ExperimentConfig
from robocasa_lerobot.training.planning.evaluations import PlannedEvaluation
from robocasa_lerobot.training.planning.plan import PhasePlan

_SHOWN = 10  # missing datasets that are listed for each phase


def render_plan(
    experiment: ExperimentConfig,
    plans: Sequence[PhasePlan],
    device: str,
    evaluations: Sequence[PlannedEvaluation] = (),
) -> str:
    """Lines for people."""
    out = [f"experiment {experiment.name}: {len(plans)} phase(s), results in {experiment.output_dir}", ""]
    for plan in plans:
        out += _phase_lines(experiment, plan)
    out += _evaluation_lines(evaluations)
    missing = list(dict.fromkeys(line for plan in plans for line in plan.missing))
    if missing:
        out += ["", f"missing datasets: {len(missing)}", *(f"  {line}" for line in missing[:_SHOWN])]
        if len(missing) > _SHOWN:
            out.append(f"  ... and {len(missing) - _SHOWN} more")
    notes = list(dict.fromkeys(f"{plan.phase.name}: {note}" for plan in plans for note in plan.notes))
    if notes:
        out += ["", "notes:", *(f"  {note}" for note in notes)]
    return "\n".join([*out, "", *_sums(plans, device)])


def _phase_lines(experiment: ExperimentConfig, plan: PhasePlan) -> list[str]:
    phase, indent = plan.phase, "  " * plan.depth
    if plan.left_out:
        return [f"{indent}{phase.name} <- {plan.start} (left out)", f"{indent}  {plan.left_out}"]
    state = "finished" if plan.done >= phase.steps else f"at step {plan.done:,}" if plan.done else "to do"
    lines = [f"{indent}{phase.name} <- {plan.start} ({state})"]
    epochs = f", {plan.samples / plan.frames:.2g} times its {plan.frames:,} frames" if plan.frames else ""
    lines.append(f"  {phase.steps:,} steps x {phase.batch_size} = {plan.samples:,} samples{epochs}")
    details = [f"statistics: {phase.statistics}"] if plan.start != "from_scratch" else []
    if phase.replay is not None:
        names = ", ".join(other.name for other in experiment.replayed(phase))
        details.append(f"replay: {phase.replay.share:.0%} of {names}")
    if plan.parameters is not None:
        total, trained = plan.parameters
        details.append(f"parameters: {total / 1e6:,.1f} M" + (f", {trained / 1e6:,.2f} M trained" * (trained != total)))
    if plan.missing:
        details.append(f"{len(plan.missing)} dataset(s) missing")
    lines += [f"  {'; '.join(details)}"] if details else []
    if plan.checkpoint_bytes is not None:
        size = f"{plan.checkpoint_bytes / 1e9:,.2f} GB"
        aside = " and one more while it is written" if plan.aside else ""
        cache = f"frame cache {plan.cache_bytes / 1e9:,.2f} GB"
        lines.append(f"  disk: {plan.kept} checkpoint(s) of {size}{aside}, {cache}")
    if plan.hours is not None and plan.seconds is not None:
        lines.append(f"  time: {plan.seconds:.3f} s per step, {plan.hours:,.1f} h to go")
    return [lines[0], *(indent + line for line in lines[1:])]


def _evaluation_lines(evaluations: Sequence[PlannedEvaluation]) -> list[str]:
    lines = []
    for item in evaluations:
        called = " ".join((item.evaluation.name, *item.evaluation.settings))
        if item.nothing is not None:
            lines.append(f"  {item.phase}: {called}: left out, {item.nothing}")
            continue
        lines.append(f"  {item.phase}: {called}: {item.trials:,} trials on {item.tasks} tasks")
        lines += [f"    {item.partial}"] if item.partial is not None else []
    return ["", "evaluations (with --evaluate):", *lines] if lines else []


def _sums(plans: Sequence[PhasePlan], device: str) -> list[str]:
    disk = sum((p.checkpoint_bytes or 0) * p.kept for p in plans)
    disk += sum({root: size for p in plans for root, size in p.cached.items()}.values())
    disk += max(((p.checkpoint_bytes or 0) * p.aside for p in plans), default=0)  # phases take turns
    unknown = [p.phase.name for p in plans if p.checkpoint_bytes is None and not p.left_out]
    without = f" (without {', '.join(unknown)})" if unknown else ""
    lines = [f"samples: {sum(p.samples for p in plans):,}", f"disk: {disk / 1e9:,.1f} GB{without}"]
    timed = [p.hours for p in plans if p.hours is not None]
    untimed = [p.phase.name for p in plans if p.hours is None and p.done < p.phase.steps and not p.left_out]
    if timed:
        name = torch.cuda.get_device_name() if device == "cuda" else device.upper()
        unit = "GPU-hours" if device == "cuda" else "hours"
        rest = f" (without {', '.join(untimed)})" if untimed else ""
        lines.append(f"time on one {name}: {sum(timed):,.1f} {unit} by measurement, without waiting for data{rest}")
    return lines
