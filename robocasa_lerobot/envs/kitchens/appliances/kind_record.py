"""A kind of appliance: its class, and the families of designs that its models are drawn from, once and for all."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.records import Family, ModelRecord

_STEP_M = 0.005  # sizes are whole multiples


@dataclass(frozen=True)
class Kind:
    """The models of a fixture type.

    Attributes:
        name, category: see `ModelRecord`.
        count: of models.
        target: how many of them belong to the target split.
        families: that the models take turns in.
        made_by: the class that builds them.
    """

    name: str
    category: str
    count: int
    target: int
    families: tuple[Family, ...]
    made_by: type[Appliance]


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
