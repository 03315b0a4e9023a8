"""What `robocasa-lerobot data` prints: hours and disk first, then the datasets, then where they come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from robocasa_lerobot.data.registry.published import DOWNLOADS
from robocasa_lerobot.making.estimate import estimate, published_hours
from robocasa_lerobot.making.needs import Content, Need
from robocasa_lerobot.training.planning.skipped import Skipped

_SHOWN = 8  # names of tasks in a line


def listing(
    name: str, file: str, needs: Sequence[Need], said: Sequence[Skipped], cores: int, asked: str = "", same: str = ""
) -> str:
    """Lines for people.

    Args:
        name: of the experiment.
        file: its file, for the command that makes the missing datasets.
        needs: the datasets.
        said: phases that are left out or partial.
        cores: that would make the missing datasets.
        asked: further options of the command that makes them.
        same: those that the command which trains takes too.
    """
    contents = {need.root: need.content() for need in needs}
    missing = [need for need in needs if need.missing]
    there = [content for content in contents.values() if content is not None]
    size = sum(content.size for content in there)
    lines = [f"experiment {name}: {len(needs)} dataset(s), {len(needs) - len(missing)} there ({_gb(size)})"]
    lines += _sums(missing, cores)
    lines += ["", *_table(needs, contents), ""]
    lines += [f"note: {item}" for item in said]
    fewer = [n for n in needs if (c := contents[n.root]) and n.made and c.episodes < (n.demonstrations or 0)]
    if fewer:
        lines.append(
            f"note: {len(fewer)} dataset(s) have fewer demonstrations than asked for; --make --replace makes them anew."
        )
    for remedy in dict.fromkeys(need.missing for need in missing if not need.made):
        tasks = [need.task for need in missing if need.missing == remedy]
        more = f" and {len(tasks) - _SHOWN} more" if len(tasks) > _SHOWN else ""
        lines.append(f"missing: {', '.join(tasks[:_SHOWN])}{more}: {remedy}")
    if any(need.made for need in missing):
        lines.append(f"make what our demonstrators can: robocasa-lerobot data {file} --make{asked}{same}")
    if not missing:
        lines.append(f"all is there: python train.py --config_path {file}{same}")
    return "\n".join(lines)


def _sums(missing: Sequence[Need], cores: int) -> list[str]:
    ours, theirs = (
        [n for n in missing if n.made],
        [n for n in missing if not n.made and (n.split, n.source) in DOWNLOADS],
    )
    lines = []
    if ours:
        e = estimate(ours, cores)
        recording, drawing = _span(e.recording_hours), _span(e.converting_hours)
        lines.append(
            f"to make: {e.demonstrations:,} demonstrations in {len(ours)} dataset(s), about {recording} of recording "
            f"and {drawing} of drawing and encoding on {cores} core(s), {_gb(e.size)} of disk"
        )
    if theirs:
        count, hours = sum(need.demonstrations or 0 for need in theirs), published_hours(theirs)
        lines.append(
            f"to download: {len(theirs)} dataset(s), {count:,} demonstrations of about {hours:,.0f} hours in all; "
            "their size on disk is not published"
        )
    return lines


def _table(needs: Sequence[Need], contents: Mapping[Path, Content | None]) -> list[str]:
    groups: dict[str, list[Need]] = {}
    for need in needs:
        groups.setdefault(need.group, []).append(need)
    width = max(len(group) for group in groups)
    lines = [f"{'datasets':<{width}}  tasks  there  demonstrations       frames      disk  from"]
    for group, members in groups.items():
        there = [content for need in members if (content := contents[need.root]) is not None]
        lacking = [need for need in members if need.missing and need.made]
        rest = estimate(lacking, 1)
        number = sum(content.episodes for content in there) + sum(n.demonstrations or 0 for n in members if n.missing)
        frames = f"{sum(content.frames for content in there) + rest.frames:,}"
        disk = _gb(sum(content.size for content in there) + rest.size)
        unknown = any(need.missing and not need.made for need in members)
        about = "~" if lacking else ""
        lines.append(
            f"{group:<{width}}  {len(members):>5}  {len(there):>5}  {f'{number:,}' if number else '-':>14}  "
            f"{'-' if unknown else about + frames:>11}  {'-' if unknown else about + disk:>8}  {_origin(members[0])}"
        )
    return lines


def _origin(need: Need) -> str:
    if need.made is None and (need.split, need.source) in DOWNLOADS:
        return "download"
    if need.made is None and need.group.startswith("published"):
        return "not published"
    if need.made is None:
        return "the user"
    if need.policy is not None:
        return f"our demonstrators, correcting {need.policy}"
    return "our demonstrators" if need.redrawn is None else f"{need.redrawn.parent}, drawn again"


def _gb(size: float) -> str:
    return f"{size / 1e9:,.1f} GB" if size >= 1e8 else f"{size / 1e6:,.0f} MB"


def _span(hours: float) -> str:
    return f"{hours:,.1f} h" if hours >= 1 else f"{max(1, round(hours * 60))} min"
