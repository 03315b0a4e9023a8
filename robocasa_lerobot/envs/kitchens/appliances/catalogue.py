"""The catalogue of appliances: 456 models in 12 categories, each in one split, and how to build one."""

from __future__ import annotations

import functools
import zlib

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Standing
from robocasa_lerobot.envs.kitchens.appliances.families import KINDS
from robocasa_lerobot.envs.kitchens.appliances.kind_record import Kind, generate
from robocasa_lerobot.envs.kitchens.appliances.records import SPLITS, ModelRecord, Size
from robocasa_lerobot.envs.kitchens.materials import Style
from robocasa_lerobot.errors import UnknownNameError, UserError

_KINDS: dict[str, Kind] = {kind.name: kind for kind in KINDS}


def register(kind: Kind) -> None:
    """Add a kind of appliance: from then on its models can be built, and layouts and tasks may name it.

    Raises:
        UserError: there is a kind of that name.
    """
    if kind.name in _KINDS:
        raise UserError(f"there is an appliance kind {kind.name!r} already: give yours another name.")
    _KINDS[kind.name] = kind


def _models() -> dict[str, ModelRecord]:
    return _models_of(tuple(_KINDS))


@functools.cache
def _models_of(names: tuple[str, ...]) -> dict[str, ModelRecord]:
    return {record.model_id: record for name in names for record in generate(_KINDS[name])}


def categories() -> tuple[str, ...]:
    """The 12 categories, e.g. "fridge"."""
    return tuple(dict.fromkeys(kind.category for kind in _KINDS.values()))


def kinds() -> tuple[str, ...]:
    """The fixture types, e.g. "fridge_french_door"; most categories have one of their own name."""
    return tuple(_KINDS)


def kinds_in(name: str) -> tuple[str, ...]:
    """The fixture types of a category, or the one of that name; none if there is neither."""
    return tuple(kind.name for kind in _KINDS.values() if kind.category == name) or ((name,) if name in _KINDS else ())


def kinds_standing(where: str) -> tuple[str, ...]:
    """The fixture types that stand in a place, e.g. on the "counter" (`Standing.where`)."""
    return tuple(kind.name for kind in _KINDS.values() if kind.made_by.standing.where == where)


def standing_of(kind: str) -> Standing:
    """Where appliances of a fixture type stand."""
    return _KINDS[kind].made_by.standing


def models_of(kind: str, split: str | None = None) -> tuple[ModelRecord, ...]:
    """The models of a fixture type, of one split or of both, in the catalogue's order.

    The name of a category of several types ("fridge") stands for all of them; "stove", which is both, for the type.

    Raises:
        UnknownNameError: no such kind or split.
    """
    if kind not in kinds():
        return models_in(kind, split)
    return _of_split([record for record in _models().values() if record.kind == kind], split)


def models_in(category: str, split: str | None = None) -> tuple[ModelRecord, ...]:
    """The models of a category, of one split or of both, in the catalogue's order.

    Raises:
        UnknownNameError: no such category or split.
    """
    if category not in categories():
        raise UnknownNameError("appliance kind", category, dict.fromkeys([*categories(), *kinds()]))
    return _of_split([record for record in _models().values() if record.category == category], split)


def _of_split(records: list[ModelRecord], split: str | None) -> tuple[ModelRecord, ...]:
    if split is not None and split not in SPLITS:
        raise UnknownNameError("split", split, SPLITS)
    return tuple(record for record in records if split in (None, record.split))


def model_of(model_id: str) -> ModelRecord:
    """The record of a model.

    Raises:
        UnknownNameError: no such model.
    """
    if model_id not in _models():
        raise UnknownNameError("appliance model", model_id, _models())
    return _models()[model_id]


def model_for(style: Style, kind: str) -> ModelRecord:
    """The model that a style has of a fixture type: the one that it names, else one drawn by its number.

    Raises:
        UnknownNameError: no such kind.
        UserError: the style's split has no model of it.
    """
    if kind in style.appliances:
        return model_of(style.appliances[kind])
    models = models_of(kind, style.split)
    if not models:
        raise UserError(f"no {kind} belongs to the {style.split} split: give its record models of both (`target`).")
    return models[zlib.crc32(f"{kind} {style.style_id}".encode()) % len(models)]


def build_appliance(
    model_id: str, name: str, pos: tuple[float, float, float], yaw: float = 0.0, size: Size | None = None
) -> Appliance:
    """A fixture of a model.

    Args:
        model_id: see `models_of`.
        name: in the scene.
        pos: centre of its box, metres.
        yaw: radians; 0 faces the room from the back wall.
        size: of the slot that it is built into; its own if None.

    Raises:
        UnknownNameError: no such model.
    """
    record = model_of(model_id)
    return _KINDS[record.kind].made_by(name, record.size if size is None else size, pos, yaw, record=record)
