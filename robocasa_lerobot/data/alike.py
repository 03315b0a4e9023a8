"""Whether datasets fit together in a mixture, and which of their pictures a policy gets."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.errors import UnknownNameError, UserError


def unseen_pictures(features: Mapping[str, Mapping[str, Any]], cameras: Sequence[str] | None) -> frozenset[str]:
    """The pictures that a policy does not get, if it gets those of some cameras only.

    Raises:
        UnknownNameError: the data have no such camera.
    """
    if cameras is None:
        return frozenset()
    found = {key: key.rpartition(".")[2] for key, feature in features.items() if contract.is_picture(feature)}
    for camera in cameras:
        if camera not in found.values():
            raise UnknownNameError("camera", camera, found.values(), "(in `loader.cameras`)")
    return frozenset(key for key, camera in found.items() if camera not in cameras)


def check_alike(sources: Sequence[DatasetSource], unseen: Collection[str], any_image_size: bool) -> None:
    """Check that all datasets have the same columns and rate: a policy cannot tell which one a batch came from.

    Args:
        sources: the datasets.
        unseen: features that need not agree.
        any_image_size: whether pictures are brought to one size.

    Raises:
        UserError: they do not.
    """
    first = sources[0]
    for other in sources[1:]:
        if other.fps != first.fps:
            raise UserError(f"{other.root} has {other.fps} frames/s, {first.root} {first.fps}.")
        for key in sorted((first.features.keys() | other.features.keys()) - set(unseen)):
            ours, theirs = first.features.get(key), other.features.get(key)
            if ours is None or theirs is None:
                lacks, has = (first, other) if ours is None else (other, first)
                remedy = ""
                if contract.is_picture(ours or theirs or {}):
                    remedy = " Name the cameras that all have in `loader.cameras`, or take other data."
                raise UserError(f"feature {key!r} is missing in {lacks.root}, and not in {has.root}.{remedy}")
            if any_image_size and contract.is_picture(ours) and contract.is_picture(theirs):
                continue
            if tuple(ours["shape"]) != tuple(theirs["shape"]) or ours.get("names") != theirs.get("names"):
                remedy = " Set `loader.image_size` to bring pictures to one size." if contract.is_picture(ours) else ""
                raise UserError(
                    f"feature {key!r}: {first.root} has shape {tuple(ours['shape'])}, names {ours.get('names')}; "
                    f"{other.root} has {tuple(theirs['shape'])}, {theirs.get('names')}.{remedy}"
                )
