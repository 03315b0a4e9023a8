"""The page of all tasks: one HTML file with its pictures in it, which loads nothing else."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2

from robocasa_lerobot.files import write_text
from robocasa_lerobot.gallery.tasks.cards import LENGTHS_S, Card, length_class
from robocasa_lerobot.gallery.tasks.pictures import Shown


@dataclass(frozen=True)
class Entry:
    """A card, what its pictures show, and these, as WebP; None where there are none."""

    card: Card
    shown: Shown | None = None
    start: bytes | None = None
    strip: bytes | None = None

    @property
    def search(self) -> str:
        """All that a search looks through, in lower case."""
        card = self.card
        shown = (self.shown.instruction, *self.shown.stages) if self.shown else ()
        said = (card.name, card.instruction, *card.paraphrases, card.summary, card.activity, card.family, *shown)
        return " ".join((*said, *card.skills, *card.fixtures, *card.sets)).lower()


@dataclass(frozen=True)
class Choice:
    """A filter: name of the data attribute, its label, and what can be chosen."""

    name: str
    label: str
    values: tuple[str, ...]


def entry(card: Card, shown: Shown | None, folder: Path) -> Entry:
    """A task with the pictures that lie in a folder."""
    if shown is None:
        return Entry(card)
    start, strip = (folder / f"{card.name}_{kind}.webp" for kind in ("start", "strip"))
    pictures = (path.read_bytes() if path.exists() else None for path in (start, strip))
    return Entry(card, shown, *pictures)


def write_page(path: Path, entries: Sequence[Entry]) -> Path:
    """Write the page and return its path."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("robocasa_lerobot.gallery"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode()
    path.parent.mkdir(parents=True, exist_ok=True)
    text = environment.get_template("tasks.html.j2").render(entries=entries, choices=choices(entries))
    write_text(path, text)
    return path


def choices(entries: Sequence[Entry]) -> list[Choice]:
    """The filters, each with what occurs."""
    cards = [each.card for each in entries]
    lengths = [length_class(seconds) for seconds in (*LENGTHS_S, LENGTHS_S[-1] + 1)]
    return [
        Choice("kind", "Kind", _sorted(card.kind for card in cards)),
        Choice("family", "Family", _sorted(card.family for card in cards)),
        Choice("activity", "Activity", _sorted(card.activity for card in cards)),
        Choice("skill", "Skill", _sorted(skill for card in cards for skill in card.skills)),
        Choice("fixture", "Fixture", _sorted(fixture for card in cards for fixture in card.fixtures)),
        Choice("length", "Human length", tuple(each for each in lengths if any(c.length == each for c in cards))),
        Choice("set", "Set", _sorted(each for card in cards for each in card.sets)),
        Choice("state", "Here", ("demonstrated", "declared", "to come")),
    ]


def _sorted(values: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted({value for value in values if value}))
