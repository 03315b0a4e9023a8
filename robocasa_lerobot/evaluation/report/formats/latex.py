r"""The report's tables as LaTeX, to be put into a paper with `\input`; needs the packages booktabs and longtable."""

from __future__ import annotations

import re

from robocasa_lerobot.evaluation.report.formats.markdown import SYNTHETIC
from robocasa_lerobot.evaluation.report.model import Cell, Document, Figure, Table

_SPECIAL = {
    "\\": r"\textbackslash{}",
    **{sign: "\\" + sign for sign in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": "$<$",
    ">": "$>$",
    "|": "$|$",
    "\N{NO-BREAK SPACE}": "~",
    "–": "--",
    "−": "$-$",
    "×": r"$\times$",
    "±": r"$\pm$",
    "≥": r"$\geq$",
    "≤": r"$\leq$",
    "·": r"$\cdot$",
    "π": r"$\pi$",
    "“": "``",
    "”": "''",
    '"': "''",
}
# Longer tables may break over pages.
LONG = 40


def render(document: Document) -> str:
    """All tables, those beside charts included, in the report's order."""
    lines = [
        f"% {_comment(document.title)}",
        f"% {_comment(document.headline)}",
        r"% needs \usepackage{booktabs} and \usepackage{longtable}",
        f"% made {document.made}",
        "",
    ]
    for section in document.sections:
        for part in section.parts:
            table = part.table if isinstance(part, Figure) else part
            if isinstance(table, Table):
                lines += [*_table(table, document.synthetic), ""]
    return "\n".join(lines)


def escape(text: str) -> str:
    """Text that LaTeX sets as it stands."""
    return "".join(_SPECIAL.get(sign, sign) for sign in text.replace("\n", " "))


def _table(table: Table, synthetic: bool) -> list[str]:
    notes = " ".join((*table.warnings, *table.notes))
    caption = f"{table.caption}. {notes}".strip()
    if synthetic:
        caption = f"{SYNTHETIC} {caption}"
    kinds = "l" + "".join("r" if column.numeric else "l" for column in table.columns[1:])
    head = (
        " & ".join(
            escape(c.label) + (r"\,(publ.)" if c.published else r"\,(ours)" if c.ours else "") for c in table.columns
        )
        + r" \\"
    )
    rows = [" & ".join(_cell(cell) for cell in row) + r" \\" for row in table.rows]
    label = rf"\caption{{{escape(caption)}}}\label{{tab:{table.id}}}"
    if len(rows) > LONG:
        return [
            rf"\begin{{longtable}}{{{kinds}}}",
            label + r" \\",
            r"\toprule",
            head,
            r"\midrule",
            r"\endhead",
            *rows,
            r"\bottomrule",
            r"\end{longtable}",
        ]
    return [
        r"\begin{table}[t]",
        r"\centering\small",
        label,
        rf"\begin{{tabular}}{{{kinds}}}",
        r"\toprule",
        head,
        r"\midrule",
        *rows,
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]


def _cell(cell: Cell) -> str:
    text = rf"\textbf{{{escape(cell.text)}}}" if cell.strong and cell.text else escape(cell.text)
    text += f" ({cell.tag})" if cell.tag else ""
    return rf"{text} {{\scriptsize ({escape(cell.interval)})}}" if cell.interval else text


def _comment(text: str) -> str:
    return re.sub(r"\s+", " ", text)
