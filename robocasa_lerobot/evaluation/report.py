"""`report.html` (one self-contained file) and `report.md`, rendered from what `report_data` computed."""

from __future__ import annotations

import datetime
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2
import yaml

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.charts import learning_curve
from robocasa_lerobot.evaluation.film_strip import choose_strips
from robocasa_lerobot.evaluation.report_data import PolicyResult, ReportData
from robocasa_lerobot.evaluation.results import TrialRecord
from robocasa_lerobot.evaluation.statistics import Rate

REFERENCES = {
    "random": "reference: actions drawn uniformly from [-1, 1] at each step",
    "zero": "reference: every action component zero",
}


def write_report(data: ReportData, out: Path) -> tuple[Path, Path]:
    """Write `out` (HTML) and the Markdown file beside it; returns both paths.

    Raises:
        UserError: `out` does not end in .html.
    """
    if out.suffix != ".html":
        raise UserError(
            f"--out {out}: found the ending {out.suffix!r}, expected .html; report.md is written beside it."
        )
    markdown = out.with_suffix(".md")
    out.parent.mkdir(parents=True, exist_ok=True)
    _write(out, render(data, "report.html.j2"))
    _write(markdown, render(data, "report.md.j2", folder=out.parent))
    return out, markdown


def render(data: ReportData, template: str, folder: Path | None = None) -> str:
    """The report's text from a template of this package; `folder` is what links to videos are relative to."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("robocasa_lerobot.evaluation"),
        autoescape=template.endswith("html.j2"),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(percent=percent, interval=interval, seconds=seconds, yaml=_yaml, cell=_cell)
    html = template.endswith("html.j2")
    return environment.get_template(template).render(
        data=data,
        headline=headline(data),
        settings=common_settings(data.policies),
        describe=describe_policy,
        strips={task: choose_strips(data.policies, task) for task in data.task_names} if html else {},
        curves=[(t, p, learning_curve(p)) for t in data.trainings for p in t.phases if p.steps] if html else [],
        videos=[] if folder is None else _video_links(data, folder),
        made=datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        trial_title=trial_title,
    )


def headline(data: ReportData) -> str:
    """The result in a sentence, about the last policy and what it is compared with."""
    last = data.policies[-1]
    return (
        "; ".join(
            [f"{last.label} solved {_of(last.pooled)}"] + [f"{p.label} {_of(p.pooled)}" for p in data.policies[:-1]]
        )
        + "."
    )


def percent(value: float) -> str:
    """A rate in [0, 1] as whole percent, e.g. `70 %`."""
    return f"{100 * value:.0f}\N{NO-BREAK SPACE}%"


def interval(rate: Rate) -> str:
    """The 95 % interval of a rate in whole percent, e.g. `40 to 89 %`."""
    return f"{100 * rate.low:.0f} to {100 * rate.high:.0f}\N{NO-BREAK SPACE}%"


def seconds(value: float | None) -> str:
    """Seconds with one decimal, or a dash for nothing."""
    return "–" if value is None else f"{value:.1f} s"


def describe_policy(policy: PolicyResult) -> str:
    """What a policy is, in a phrase."""
    path = policy.policy["path"]
    if path in REFERENCES:
        return REFERENCES[path]
    if policy.policy["phase"] is None:
        return f"{policy.policy['type']} from {path}"
    untrained = " (untrained)" if policy.policy["step"] == 0 else ""
    return f"{policy.policy['type']}, phase {policy.policy['phase']}, step {policy.policy['step']:,}{untrained}"


def trial_title(record: TrialRecord) -> str:
    """What a trial's square says when pointed at."""
    if record.error is not None:
        return f"trial {record.trial}, seed {record.seed}: error"
    result = f"success at step {record.first_success_step}" if record.success else f"failure after {record.steps} steps"
    return f"trial {record.trial}, seed {record.seed}: {result}"


def common_settings(policies: Sequence[PolicyResult]) -> list[tuple[str, str]]:
    """Every setting with its value; one that differs between the policies is listed with each policy's value."""
    rows = []
    for group in ("settings", "versions"):
        tables: list[dict[str, Any]] = [getattr(policy, group) for policy in policies]
        for name in dict.fromkeys(key for table in tables for key in table):
            rows.append((name, _same_or_each([_plain(table.get(name)) for table in tables], policies)))
    rows.insert(0, ("episode length", _same_or_each([_horizons(policy) for policy in policies], policies)))
    commits = [", ".join(policy.git_commits) or "not in a git checkout" for policy in policies]
    rows.append(("git commit", _same_or_each(commits, policies)))
    return rows


def _same_or_each(values: list[str], policies: Sequence[PolicyResult]) -> str:
    if len(set(values)) == 1:
        return values[0]
    return "; ".join(f"{policy.label}: {value}" for policy, value in zip(policies, values, strict=True))


def _horizons(policy: PolicyResult) -> str:
    """Control steps after which a trial ends, for each task."""
    lengths = {result.task: result.trials[0].horizon for result in policy.tasks}
    return ", ".join(f"{task} {steps or 'set by the env'} steps" for task, steps in lengths.items())


def _plain(value: Any) -> str:
    return "default" if value is None else str(value)


def _of(rate: Rate) -> str:
    return f"{rate.successes} of {rate.trials} trials ({percent(rate.rate)}, 95 % interval {interval(rate)})"


def _video_links(data: ReportData, folder: Path) -> list[tuple[PolicyResult, TrialRecord, str]]:
    links = []
    for policy in data.policies:
        for record in (record for result in policy.tasks for record in result.trials if record.video is not None):
            video = policy.folder / str(record.video)
            if video.is_file():
                links.append((policy, record, Path(os.path.relpath(video, folder)).as_posix()))
    return links


def _yaml(value: Any) -> str:
    return str(yaml.safe_dump(value, sort_keys=False, allow_unicode=True))


def _cell(value: Any) -> str:
    """Text that cannot break out of a Markdown table cell."""
    return str(value).replace("|", "\\|").replace("\n", " ")


def _write(path: Path, text: str) -> None:
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)
