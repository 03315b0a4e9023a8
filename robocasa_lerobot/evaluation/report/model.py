"""What a report is made of, before any format: sections of text, tables, figures and films."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from robocasa_lerobot.evaluation.statistics import Estimate


@dataclass(frozen=True)
class Bar:
    """A horizontal bar in a cell: a rate with its interval in [0, 1]; `series` picks the colour (0 is the first).

    `published` is a mark at a published rate; `loss` colours the bar as something unwanted.
    """

    estimate: Estimate
    series: int = 0
    published: float | None = None
    loss: bool = False
    whisker: bool = True


@dataclass(frozen=True)
class Cell:
    """A cell: its text, the number that it is sorted by, and the drawing beside or beneath.

    `interval` is small print under the text; `heat` in [0, 1] shades the cell; `tag` is a word beside the text, such as
    "published"; `series` puts a policy's colour before it; `marks` are squares for single trials: s(olved), f(ailed),
    e(rror), with a title each.
    """

    text: str
    value: float | None = None
    interval: str = ""
    bar: Bar | None = None
    heat: float | None = None
    strong: bool = False
    muted: bool = False
    tag: str = ""
    code: bool = False
    marks: tuple[tuple[str, str], ...] = ()
    series: int | None = None


@dataclass(frozen=True)
class Column:
    """A column: its heading, whether it holds numbers, published ones, or ours beside those."""

    label: str
    numeric: bool = False
    published: bool = False
    ours: bool = False
    wide: bool = False
    series: int | None = None


@dataclass(frozen=True)
class Table:
    """A table with its caption; the first cell of each row is the row's heading. `notes` stand below it.

    `warnings` are visible notes on what makes its columns incomparable. `cards`: on narrow screens each row is a card.
    """

    id: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    sortable: bool = True
    folded: bool = False
    cards: bool = False


@dataclass(frozen=True)
class Series:
    """A name in a legend with its number in the palette."""

    label: str
    number: int


@dataclass(frozen=True)
class Figure:
    """A chart as inline SVG, with its numbers as a table for those who do not see it, and for copying."""

    id: str
    title: str
    svg: str
    table: Table
    caption: str = ""
    legend: tuple[Series, ...] = ()


@dataclass(frozen=True)
class Frame:
    """A moment of a trial: seconds of simulated time since the reset, and the picture as a data URI."""

    seconds: float
    uri: str


@dataclass(frozen=True)
class Film:
    """Moments of one filmed trial, and its video as a data URI where it is small enough."""

    title: str
    success: bool
    facts: str
    instruction: str
    frames: tuple[Frame, ...]
    video: str | None = None
    speed: float = 1.0


@dataclass(frozen=True)
class Card:
    """The result of one policy in the summary."""

    label: str
    text: str
    bar: Bar
    line: str
    what: str


@dataclass(frozen=True)
class Listing:
    """Names with values, such as settings."""

    title: str
    items: tuple[tuple[str, str], ...]
    folded: bool = False


@dataclass(frozen=True)
class Block:
    """Preformatted text behind a heading that unfolds: a configuration, a traceback."""

    title: str
    text: str


Part = Table | Figure | Listing | Block | Film


@dataclass(frozen=True)
class Section:
    """A section of the report; `text` are paragraphs before its parts, `sentences` are paragraphs with a catchword.

    `marks_legend` says what the squares of single trials are, where there are any.
    """

    id: str
    title: str
    text: tuple[str, ...] = ()
    sentences: tuple[tuple[str, str], ...] = ()
    cards: tuple[Card, ...] = ()
    parts: tuple[Part, ...] = ()
    legend: tuple[Series, ...] = ()
    marks_legend: str = ""


@dataclass(frozen=True)
class Document:
    """The whole report."""

    title: str
    headline: str
    sections: Sequence[Section]
    made: str
    synthetic: bool
    subtitle: str = ""
    source: str = "trials.jsonl"
    tags: tuple[str, ...] = field(default=())
