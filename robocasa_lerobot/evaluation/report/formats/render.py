"""`report.html` (one self-contained file), `.md`, `.tex` and two `.csv`, all from the same data."""

from __future__ import annotations

import re
from pathlib import Path

import jinja2
from markupsafe import Markup

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.report.formats import latex, markdown, tables_csv
from robocasa_lerobot.evaluation.report.formats import tidy_csv as tidy
from robocasa_lerobot.evaluation.report.formats.charts import SERIES
from robocasa_lerobot.evaluation.report.model import Document, Part
from robocasa_lerobot.evaluation.report.policies import ReportData
from robocasa_lerobot.files import write_text


def check_ending(out: Path) -> None:
    """Raise UserError if `out` does not end in .html; what is written beside it has other endings."""
    if out.suffix != ".html":
        raise UserError(f"--out {out}: found the ending {out.suffix!r}, expected .html; other formats come beside it.")


def write_report(document: Document, data: ReportData, out: Path) -> list[Path]:
    """Write `out` (HTML) and its Markdown, LaTeX and CSV files beside it; returns all paths.

    Raises:
        UserError: `out` does not end in .html.
    """
    check_ending(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    texts = {
        out: html(document),
        out.with_suffix(".md"): markdown.render(document, data, out.parent),
        out.with_suffix(".tex"): latex.render(document),
        out.with_suffix(".csv"): tidy.render(data),
        out.with_name(f"{out.stem}_tables.csv"): tables_csv.render(data),
    }
    for path, text in texts.items():
        write_text(path, text)
    return list(texts)


def write_page(document: Document, out: Path) -> None:
    """Write a document as one HTML file.

    Raises:
        UserError: `out` does not end in .html.
    """
    check_ending(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_text(out, html(document))


def html(document: Document) -> str:
    """The page: styles, script, charts, pictures and films inside, nothing loaded from anywhere."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("robocasa_lerobot.evaluation.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["width"] = lambda share: f"{100 * min(1.0, max(0.0, share)):.2f}%"
    environment.filters["series"] = lambda number: f"s{number % SERIES + 1}"
    environment.filters["breakable"] = _breakable
    environment.finalize = _unbroken
    environment.tests["part"] = _is_a
    return environment.get_template("report.html.j2").render(document=document)


def _is_a(part: Part, kind: str) -> bool:
    return type(part).__name__ == kind


def _breakable(name: str) -> Markup:
    """A task's name that may break before its words, and nowhere else."""
    return Markup("<wbr>").join(re.sub(r"(?<=[a-z])(?=[A-Z])", "\n", name).split("\n"))


def _unbroken(value: object) -> object:
    """Numbers stay on the line of their percent sign."""
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return re.sub(r"(?<=\d) %", "\N{NO-BREAK SPACE}%", value)
