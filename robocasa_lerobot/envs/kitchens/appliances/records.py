"""What an appliance model is made from: a record, drawn once and for all from the families of its category."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Size = tuple[float, float, float]

SPLITS = ("pretrain", "target")
_STEP_M = 0.005  # sizes are whole multiples


@dataclass(frozen=True)
class ModelRecord:
    """One appliance model.

    Attributes:
        model_id: kind and number, e.g. "microwave_017".
        category: one of the 12, e.g. "fridge".
        kind: the fixture type; the category, or a part of it, e.g. "fridge_french_door".
        split: "pretrain" or "target"; no model is in both.
        size: natural width, depth and height, metres.
        params: family, finishes and details that its class builds from.
    """

    model_id: str
    category: str
    kind: str
    split: str
    size: Size
    params: dict[str, Any] = field(hash=False)

    def __getitem__(self, key: str) -> Any:
        """A parameter."""
        return self.params[key]


@dataclass(frozen=True)
class Family:
    """A design that several models share.

    Attributes:
        name: of the design.
        low, high: bounds of width, depth and height, metres.
        finishes: of the body, by the names of `finishes.py`.
        details: for each parameter, the values that it may have.
    """

    name: str
    low: Size
    high: Size
    finishes: tuple[str, ...]
    details: dict[str, tuple[Any, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Kind:
    """The models of a fixture type.

    Attributes:
        name, category: see `ModelRecord`.
        count: of models.
        target: how many of them belong to the target split.
        families: that the models take turns in.
    """

    name: str
    category: str
    count: int
    target: int
    families: tuple[Family, ...]


def generate(kind: Kind) -> tuple[ModelRecord, ...]:
    """The models of a kind; a pure function of its families, with sizes in steps of 5 mm."""
    key = zlib.crc32(kind.name.encode())
    in_target = set(np.random.default_rng(key).permutation(kind.count)[: kind.target].tolist())
    records = []
    for index in range(kind.count):
        family = kind.families[index % len(kind.families)]
        turn = index // len(kind.families)
        rng = np.random.default_rng([key, index])
        low, high = np.array(family.low), np.array(family.high)
        size = tuple(float(v) for v in np.round(rng.uniform(low, high) / _STEP_M) * _STEP_M)
        params: dict[str, Any] = {"family": family.name, "finish": family.finishes[turn % len(family.finishes)]}
        for name, values in sorted(family.details.items()):
            params[name] = values[int(rng.integers(len(values)))]
        records.append(
            ModelRecord(
                model_id=f"{kind.name}_{index:03d}",
                category=kind.category,
                kind=kind.name,
                split="target" if index in in_target else "pretrain",
                size=(round(size[0], 3), round(size[1], 3), round(size[2], 3)),
                params=params,
            )
        )
    return tuple(records)
