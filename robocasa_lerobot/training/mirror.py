"""Samples as in a mirror: what is on the left is on the right, in pictures, state, actions and instruction.

PandaOmron is its own mirror image in the vertical plane through its base: cameras beside the hand come in a pair, the
wrist's stands in the plane of the fingers' middle, and commands are those of the hand. So the mirrored sample is one of
the mirrored kitchen, which no one had to build. What shows on which side it belongs, such as writing or the hinge of a
microwave, is then seen on the other side as well.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from robocasa_lerobot.contract import ACTION_KEY, ACTION_PARTS, STATE_KEY, STATE_PARTS, TASK_KEY, component_names
from robocasa_lerobot.data.mixture import MixtureMeta
from robocasa_lerobot.data.statistics import Statistics
from robocasa_lerobot.errors import UserError


@dataclass(frozen=True)
class _Reflection:
    """What a mirror makes of a vector: component i becomes `signs[i]` times what component `sources[i]` was."""

    sources: tuple[int, ...]
    signs: tuple[float, ...]

    @classmethod
    def of(cls, names: Sequence[str], negated: Sequence[str], swapped: tuple[str, ...] = ()) -> _Reflection:
        """That which negates some components, and negates the two of `swapped` and lets them change places."""
        sources = [names.index(name) for name in names]
        for name, other in zip(swapped, reversed(swapped), strict=True):
            sources[names.index(name)] = names.index(other)
        signs = [-1.0 if name in negated or name in swapped else 1.0 for name in names]
        return cls(tuple(sources), tuple(signs))

    def __call__(self, vector: Tensor) -> Tensor:
        return vector[..., list(self.sources)] * vector.new_tensor(self.signs)


# Components that change their sign: what points to the side, and turns about axes in the plane. A reflection y -> -y
# takes the rotation of a quaternion (x, y, z, w) to (-x, y, -z, w), and a rotation vector likewise.
# Fingers stand at positions of opposite sign. Quaternions keep w >= 0.
_REFLECTIONS = {
    STATE_KEY: _Reflection.of(
        component_names(STATE_PARTS),
        ("base_y", "base_qx", "base_qz", "eef_y", "eef_qx", "eef_qz"),
        swapped=("finger_1", "finger_2"),
    ),
    ACTION_KEY: _Reflection.of(component_names(ACTION_PARTS), ("base_left", "base_yaw", "eef_dy", "eef_rx", "eef_rz")),
}
_OPPOSITE = {"min": "max", "q01": "q99", "q10": "q90", "q50": "q50", "q90": "q10", "q99": "q01", "max": "min"}
# Sides, the only group; before them what has these words and means none, which is passed over.
_SIDES = re.compile(
    r"what is left\b|\b(?:is|are|be) left\b(?! of\b)|\bleft (?:behind|over)\b"
    r"|\bright (?:way|beside|next|away|tool)\b|\bon the right one\b"
    r"|\b(left|right)(?=most\b|\b)",
    re.IGNORECASE,
)
_OTHER = {"left": "right", "right": "left"}


def mirror(batch: dict[str, Any], cameras: list[str], chosen: Tensor) -> dict[str, Any]:
    """The batch with the samples `chosen` mirrored.

    Args:
        batch: pictures (B, ..., H, W), `observation.state` (B, ..., 16), `action` (B, ..., 12) as datasets have them,
            not normalised, and `task`, B instructions.
        cameras: keys of pictures; one with `left` in its name belongs to the one with `right` in its place.
        chosen: (B,) bool.
        What of these can be mirrored, `check_mirror` says.
    """
    out = dict(batch)
    for key in cameras:
        flipped = batch[swap_sides(key)].flip(-1)
        out[key] = torch.where(_wide(chosen, flipped), flipped, batch[key])
    for key, reflection in _REFLECTIONS.items():
        out[key] = torch.where(_wide(chosen, batch[key]), reflection(batch[key]), batch[key])
    which = chosen.tolist()
    out[TASK_KEY] = [mirror_text(t) if c else t for t, c in zip(batch[TASK_KEY], which, strict=True)]
    return out


def check_mirror(meta: MixtureMeta) -> None:
    """Check that samples of a mixture can be mirrored.

    Raises:
        UserError: state or action are not those of the contract, or a camera of a pair is missing.
    """
    cameras = meta.camera_keys
    for key, reflection in _REFLECTIONS.items():
        expected, found = [len(reflection.signs)], list(meta.features.get(key, {}).get("shape", ()))
        if found != expected:
            raise UserError(
                f"augment: mirror: {key} has the shape {found}, expected {expected}, that of PandaOmron, whose sides "
                "are known. Leave `mirror` out."
            )
    for key in cameras:
        if swap_sides(key) not in cameras:
            raise UserError(
                f"augment: mirror: {key} becomes {swap_sides(key)} in a mirror, which is not among the cameras: "
                f"{', '.join(cameras)}. Train on both, or leave `mirror` out."
            )


def mirror_state(state: Tensor) -> Tensor:
    """State (..., 16) in the mirror."""
    return _REFLECTIONS[STATE_KEY](state)


def mirror_action(action: Tensor) -> Tensor:
    """Actions (..., 12) in the mirror."""
    return _REFLECTIONS[ACTION_KEY](action)


def mirror_statistics(stats: Statistics, share: float) -> Statistics:
    """Statistics of data of which so large a share is seen in the mirror.

    Means, standard deviations and extremes are exact. Quantiles of a union do not follow from those of its parts: the
    lower of both, and the higher above the median, whose weighted mean is taken.
    """
    out = dict(stats)
    for key, reflection in _REFLECTIONS.items():
        if key in stats:
            out[key] = _joined(stats[key], _mirrored(stats[key], reflection), share)
    return out


def mirror_text(text: str) -> str:
    """An instruction with its sides swapped."""
    return _SIDES.sub(_other_side, text)


def swap_sides(name: str) -> str:
    """A name with `left` and `right` swapped."""
    return re.sub("left|right", lambda found: _OTHER[found.group()], name)


def _other_side(found: re.Match[str]) -> str:
    word = found.group(1)
    if word is None:
        return found.group()
    other = _OTHER[word.lower()]
    return other.capitalize() if word[0].isupper() else other


def _mirrored(values: dict[str, NDArray[Any]], reflection: _Reflection) -> dict[str, NDArray[Any]]:
    sources, signs = list(reflection.sources), np.array(reflection.signs)
    out = {}
    for name, value in values.items():
        if name == "count":
            out[name] = value
        elif name == "std":
            out[name] = value[sources]
        elif name == "mean":
            out[name] = signs * value[sources]
        else:
            out[name] = np.where(signs > 0, value[sources], -values[_OPPOSITE[name]][sources])
    return out


def _joined(own: dict[str, NDArray[Any]], other: dict[str, NDArray[Any]], share: float) -> dict[str, NDArray[Any]]:
    out = {}
    for name, value in own.items():
        if name in ("min", "q01", "q10"):
            out[name] = np.minimum(value, other[name])
        elif name in ("max", "q99", "q90"):
            out[name] = np.maximum(value, other[name])
        elif name == "std":
            # Var[x] = E[Var[x | side]] + Var[E[x | side]]
            apart = share * (1 - share) * (own["mean"] - other["mean"]) ** 2
            out[name] = np.sqrt((1 - share) * value**2 + share * other[name] ** 2 + apart)
        elif name == "count":
            out[name] = value
        else:
            out[name] = (1 - share) * value + share * other[name]
    return out


def _wide(chosen: Tensor, like: Tensor) -> Tensor:
    return chosen.to(like.device).reshape(-1, *[1] * (like.ndim - 1))
