"""What an appliance model is made from: a record, and the family of designs that it is drawn from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

Size = tuple[float, float, float]

SPLITS = ("pretrain", "target")


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
