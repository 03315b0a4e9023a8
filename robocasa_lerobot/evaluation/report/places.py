"""Which of our policies stand beside which published numbers, as `places.yaml` says."""

from __future__ import annotations

import fnmatch
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import yaml

from robocasa_lerobot.benchmark.published import read
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.records.results import PolicyInfo, RunHeader

PER_TASK = "per_task"
PERTURBATIONS = "perturbations"
_UNPUBLISHED = "unpublished"
_KEYS = ("experiment", "phase", "type", "protocol", "demo_fraction", "training_data", "lifelong_phase")
Description = Mapping[str, Sequence[object]]


@dataclass(frozen=True)
class Place:
    """Where a policy stands: a published table, and the column and row that it is for.

    `column` or `row` is None where these are task sets, perturbations or tasks, of which a policy may fill several.
    """

    table: str
    column: str | None = None
    row: str | None = None


def places(info: PolicyInfo, header: RunHeader) -> tuple[Place, ...]:
    """Where a policy of a run stands, in the order of tables and columns; none for one like no published policy."""
    return tuple(place for table in tables() for place in _places_in(table, _facts(info, header)))


@functools.cache
def tables() -> dict[str, dict[str, Any]]:
    """The tables of `places.yaml` by name.

    Raises:
        UserError: a table, column, row or key that there is not.
    """
    found = {name: table for name, table in _content().items() if name != _UNPUBLISHED}
    for name, table in found.items():
        published = read(name)
        for part in ("columns", "rows"):
            known = [entry["key"] for entry in published.get(part, [])] if name != PER_TASK else ["best"]
            if not set(table.get(part, ())) <= set(known):
                raise UserError(f"places.yaml: {part} of {name} are {list(table[part])}, expected some of {known}.")
    for description in _descriptions(found):
        if not set(description) <= set(_KEYS):
            raise UserError(f"places.yaml: {dict(description)}: expected keys out of {', '.join(_KEYS)}.")
    return found


@functools.cache
def named_experiments() -> frozenset[str]:
    """Names of experiments in `places.yaml`, or patterns; other experiments' policies are placed by their labels."""
    own = (str(name) for one in _descriptions(tables()) for name in one.get("experiment", ()))
    return frozenset((*own, *_content()[_UNPUBLISHED]))


@functools.cache
def _content() -> dict[str, Any]:
    text = resources.files(__package__).joinpath("places.yaml").read_text(encoding="utf-8")
    return dict(yaml.safe_load(text))


def _descriptions(found: Mapping[str, Mapping[str, Any]]) -> Iterator[Description]:
    for table in found.values():
        yield from table.get("policies", [])
        yield from table.get("rows", {}).values()
        for alternatives in table.get("columns", {}).values():
            yield from alternatives


def _places_in(name: str, facts: Mapping[str, object]) -> Iterator[Place]:
    table = tables()[name]
    if "policies" in table and not _any_fits(table["policies"], facts):
        return
    columns: list[str | None] = [None]
    if "columns" in table:
        columns = [key for key, alternatives in table["columns"].items() if _any_fits(alternatives, facts)]
    rows: list[str | None] = [None]
    if "rows" in table:
        rows = [key for key, description in table["rows"].items() if _fits(description, facts)]
    yield from (Place(name, column, row) for column in columns for row in rows)


def _any_fits(alternatives: Sequence[Description], facts: Mapping[str, object]) -> bool:
    experiment = str(facts["experiment"])
    named = any(fnmatch.fnmatchcase(experiment, name) for name in named_experiments())
    return any(("experiment" in one) is named and _fits(one, facts) for one in alternatives)


def _fits(description: Description, facts: Mapping[str, object]) -> bool:
    return all(facts[key] in values for key, values in description.items())


def _facts(info: PolicyInfo, header: RunHeader) -> dict[str, object]:
    values: dict[str, object] = {
        "experiment": info.experiment,
        "phase": info.phase,
        "type": info.type,
        "protocol": header.protocol,
        "demo_fraction": info.demo_fraction,
        "training_data": (info.training_data or "").strip().lower().replace(",", ""),
        "lifelong_phase": info.lifelong_phase,
    }
    return {key: "" if value is None else value for key, value in values.items()}
