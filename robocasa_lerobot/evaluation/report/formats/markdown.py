"""The report as Markdown: text and tables; charts are their tables, films are links."""

from __future__ import annotations

import os
import re
import urllib.parse
from pathlib import Path

from robocasa_lerobot.evaluation.report.model import Block, Cell, Document, Figure, Film, Listing, Part, Table
from robocasa_lerobot.evaluation.report.policies import ReportData, trial_title

SYNTHETIC = "Synthetic trials: drawn at random to show what a report looks like. No policy ran."


def render(document: Document, data: ReportData, folder: Path) -> str:
    """The text; `folder` is what links to videos are relative to."""
    lines = [f"# {escape(document.title)}", ""]
    if document.synthetic:
        lines += [f"> **{SYNTHETIC}**", ""]
    lines += [escape(document.headline), "", f"Made {document.made}.", ""]
    for section in document.sections:
        if section.id == "films":
            continue
        lines += [f"## {escape(section.title)}", ""]
        for paragraph in section.text:
            lines += [escape(paragraph), ""]
        for name, sentence in section.sentences:
            lines += [f"**{name}.** {escape(sentence)}", ""]
        for card in section.cards:
            lines.append(f"- **{escape(card.label)}: {card.text}** ({escape(card.line)}). {escape(card.what)}")
        lines += [""] if section.cards else []
        for part in section.parts:
            lines += _part(part)
    lines += _videos(data, folder)
    return "\n".join(lines).rstrip() + "\n"


def escape(text: str) -> str:
    """Text that Markdown shows as it stands."""
    return re.sub(r"([\\`*_<>\[\]|#])", r"\\\1", text).replace("\n", " ")


def _part(part: Part) -> list[str]:
    match part:
        case Table():
            return _table(part)
        case Figure():
            return _table(part.table)
        case Listing():
            rows = [f"| {escape(name)} | {escape(value)} |" for name, value in part.items]
            return [f"**{escape(part.title)}**", "", "| setting | value |", "|---|---|", *rows, ""]
        case Block():
            fence = "`" * max(3, 1 + max((len(run) for run in re.findall(r"`+", part.text)), default=0))
            return [f"**{escape(part.title)}**", "", fence, part.text.rstrip("\n"), fence, ""]
        case Film():
            return []


def _table(table: Table) -> list[str]:
    lines = [f"**{escape(table.caption)}**", ""]
    for warning in table.warnings:
        lines += [f"> {escape(warning)}"]
    lines += [""] if table.warnings else []
    heads = (
        escape(column.label) + (" (published)" if column.published else " (ours)" if column.ours else "")
        for column in table.columns
    )
    lines.append("| " + " | ".join(heads) + " |")
    lines.append("|" + "|".join("---:" if column.numeric else "---" for column in table.columns) + "|")
    lines += ["| " + " | ".join(_cell(cell) for cell in row) + " |" for row in table.rows]
    lines.append("")
    for note in table.notes:
        lines += [escape(note), ""]
    return lines


def _cell(cell: Cell) -> str:
    text = f"`{cell.text}`" if cell.code and not set("`|") & set(cell.text) else escape(cell.text)
    text += f" [{cell.tag}]" if cell.tag else ""
    return f"{text} ({escape(cell.interval)})" if cell.interval else text


def _videos(data: ReportData, folder: Path) -> list[str]:
    lines = []
    for policy in data.single:
        for result in policy.tasks:
            for record in result.trials:
                if record.video is None or not (policy.folder / record.video).is_file():
                    continue
                link = urllib.parse.quote(os.path.relpath(policy.folder / record.video, folder))
                what = f"{record.task}, {policy.label}, {trial_title(record)}"
                lines.append(f"- [{escape(what)}]({link})")
    return ["## Films", "", *lines, ""] if lines else []
