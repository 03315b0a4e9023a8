"""Where the numbers come from: settings, versions, checkpoints and errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from robocasa_lerobot.evaluation.records.results import REFERENCE_TYPES, REPLAY, UNPERTURBED, PolicyInfo
from robocasa_lerobot.evaluation.report.left_out import lacking
from robocasa_lerobot.evaluation.report.model import Block, Listing, Section
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, describe_policy
from robocasa_lerobot.evaluation.report.sections.beside_published import horizon_phrase, success_phrase

MAX_ERRORS = 30
MAX_SAID = 20  # lines of what a server says about itself
MAX_VALUES = 3  # of a setting that runs of one policy differ in


def section(data: ReportData) -> Section:
    """Settings in common first, then each policy."""
    parts: list[Listing | Block] = [Listing("Settings and versions", tuple(common_settings(data.single)))]
    for policy in data.single:
        items = (
            ("what", describe_policy(policy)),
            ("path", policy.info.path),
            *_what_decided(policy.info),
            ("results", f"{policy.folder.name}/{policy.file}"),
        )
        parts.append(Listing(policy.label, items, folded=len(data.single) > 2))
    return Section("settings", "Settings and provenance", parts=tuple(parts))


def _what_decided(info: PolicyInfo) -> list[tuple[str, str]]:
    """What made the actions: weights or stored actions that were hashed, or a server that was asked."""
    if info.type == REPLAY:
        return [("stored actions", f"{info.fingerprint} (SHA-256)")]
    if info.type in REFERENCE_TYPES:  # without any weights
        return []
    if info.remote is None:
        return [("weights", f"{info.fingerprint} (SHA-256)")]
    remote = flat(info.remote)
    said = [
        (f"server: {name.removeprefix('metadata.')}", _plain(remote[name]))
        for name in remote
        if name.startswith("metadata.")
    ]
    return [
        ("weights", f"{info.remote['weights']}: they are behind a socket"),
        ("key map", f"{info.remote['keys']}; with the server's metadata {info.fingerprint} (SHA-256)"),
        ("executed steps of each answer", str(info.remote["key_map"]["executed_steps"])),
        ("outcomes", str(info.remote["outcomes"])),
        *said[:MAX_SAID],
    ]


def errors(data: ReportData) -> Section | None:
    """The tracebacks of trials that ended in an error."""
    broken = [
        record
        for policy in data.policies
        for tasks in policy.conditions.values()
        for result in tasks
        for record in result.trials
        if record.error is not None
    ]
    if not broken:
        return None
    text = (
        (f"The first {MAX_ERRORS} of {len(broken)}; all are in the results file.",) if len(broken) > MAX_ERRORS else ()
    )
    parts = tuple(
        Block(f"{r.label} · {r.task} · trial {r.trial} · seed {r.seed}: {r.outcome}", str(r.error))
        for r in broken[:MAX_ERRORS]
    )
    return Section("errors", "Errors", text, parts=parts)


def common_settings(policies: Sequence[PolicyResult]) -> list[tuple[str, str]]:
    """Every setting with its value; one that differs between the policies is listed with each policy's value."""
    rows = []
    for name, phrase in (("a trial lasts", horizon_phrase), ("a trial is solved", success_phrase)):
        rows.append((name, _same_or_each([phrase(policy) for policy in policies], policies)))
    if any(name != UNPERTURBED for policy in policies for name in policy.conditions):
        rows.append(("perturbations", _same_or_each([", ".join(policy.conditions) for policy in policies], policies)))
    heads = (
        "protocol",
        "split",
        "trials",
        "seed",
        "render_preset",
        "image_size",
        "executed_steps",
        "device",
        "started",
    )
    for name in heads:
        values = [_over_runs(policy, [getattr(header, name) for header in policy.headers]) for policy in policies]
        rows.append((name.replace("_", " "), _same_or_each(values, policies)))
    for group in ("settings", "versions", "machine"):
        tables: list[list[dict[str, Any]]] = [[flat(getattr(h, group)) for h in policy.headers] for policy in policies]
        for name in dict.fromkeys(key for runs in tables for table in runs for key in table):
            if name in heads:
                continue
            values = [
                _over_runs(policy, [table.get(name) for table in runs])
                for policy, runs in zip(policies, tables, strict=True)
            ]
            rows.append((name.replace("_", " "), _same_or_each(values, policies)))
    commits = [
        ", ".join(sorted({h.git_commit for h in policy.headers if h.git_commit})) or "not in a git checkout"
        for policy in policies
    ]
    rows.append(("git commit", _same_or_each(commits, policies)))
    missing = sorted({task for policy in policies for _, tasks, _ in lacking(policy) for task in tasks})
    if missing:
        rows.append(("tasks of the protocol left out", ", ".join(missing)))
    return rows


def flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested settings as one level, names joined by dots."""
    out: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict) and value:
            out |= flat(value, f"{prefix}{name}.")
        else:
            out[prefix + name] = value
    return out


def _over_runs(policy: PolicyResult, values: Sequence[Any]) -> str:
    """What a setting was in the runs that a policy's results are from: a run that is continued may be elsewhere."""
    found = list(dict.fromkeys(_plain(value) for value in values))
    if len(found) <= MAX_VALUES:
        return ", ".join(found)
    return f"{found[0]} ... {found[-1]} (of {len(policy.headers)} runs)"


def _same_or_each(values: list[str], policies: Sequence[PolicyResult]) -> str:
    if len(set(values)) == 1:
        return values[0]
    return "; ".join(f"{policy.label}: {value}" for policy, value in zip(policies, values, strict=True))


def _plain(value: Any) -> str:
    if value is None:
        return "default"
    if isinstance(value, list):
        return ", ".join(map(str, value)) if len(value) <= 12 else f"{len(value)} values"
    return "yes" if value is True else "no" if value is False else str(value)
