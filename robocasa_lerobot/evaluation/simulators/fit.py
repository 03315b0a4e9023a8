"""Whether a policy can look at what another simulator shows: by LeRobot's names, before it gives a first action."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource, env_names

_NUMBERS = {"agent_pos": "observation.state", "environment_state": "observation.environment_state"}


class UnfitPolicyError(UserError):
    """A policy that the env is not for: no other trial will get around it."""


@dataclass(frozen=True)
class Needs:
    """What a policy looks at, by LeRobot's names of an env's observations.

    `numbers` are sizes of vectors; of `pictures` one has to be there, or all where `all_pictures` says so: LeRobot's
    policies do without a camera, a server's key map does not.
    """

    label: str
    pictures: frozenset[str] = frozenset()
    all_pictures: bool = False
    numbers: dict[str, int] = field(default_factory=dict)

    def check(self, observation: Mapping[str, Any]) -> None:
        """Compare with an observation that has its pictures.

        Raises:
            UnfitPolicyError: something is missing or has another size; all that is there is named.
        """
        pixels = observation.get("pixels")
        shown = {contract.image_key(name) for name in pixels} if isinstance(pixels, Mapping) else set()
        if pixels is not None and not isinstance(pixels, Mapping):
            shown = {"observation.image"}
        sizes = {name: int(np.size(observation[key])) for key, name in _NUMBERS.items() if key in observation}
        lacking = [f"{name} of {size} numbers" for name, size in self.numbers.items() if sizes.get(name) != size]
        missing = sorted(self.pictures - shown)
        if missing and (self.all_pictures or not self.pictures & shown):
            lacking += missing
        if lacking:
            there = [*(f"{name} of {size} numbers" for name, size in sizes.items()), *sorted(shown)]
            raise UnfitPolicyError(
                f"policy {self.label!r} looks at {', '.join(lacking)}, and the env shows {', '.join(there)}: it was "
                "trained for another robot or other cameras. An adapter can give its observations these names."
            )


def needs_of(source: PolicySource) -> Needs | None:
    """What a policy looks at; None for reference policies, which look at nothing."""
    if source.remote is not None:
        key_map = source.remote.key_map
        return Needs(
            source.label,
            frozenset(contract.image_key(one.camera) for one in key_map.cameras),
            all_pictures=True,
            numbers={contract.STATE_KEY: contract.STATE_SIZE} if key_map.state else {},
        )
    if source.is_reference:
        return None
    folder = Path(source.path)
    inputs = json.loads((folder / "config.json").read_text(encoding="utf-8")).get("input_features") or {}
    names = env_names(folder)
    pictures, numbers = set(), {}
    for name, feature in inputs.items():
        own = names.get(name, name)
        if own in _NUMBERS.values():
            numbers[own] = int(np.prod(feature["shape"]))
        elif feature.get("type") == "VISUAL":
            pictures.add(own)
    return Needs(source.label, frozenset(pictures), numbers=numbers)
