"""The catalogue of appliances: 456 models in 12 categories, each in one split, and how to build one."""

from __future__ import annotations

import functools

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.families import KINDS
from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.kitchens.appliances.kinds.coffee_machine import CoffeeMachine
from robocasa_lerobot.envs.kitchens.appliances.kinds.dishwasher import Dishwasher
from robocasa_lerobot.envs.kitchens.appliances.kinds.electric_kettle import ElectricKettle
from robocasa_lerobot.envs.kitchens.appliances.kinds.fridge import (
    BottomFreezerFridge,
    FrenchDoorFridge,
    SideBySideFridge,
)
from robocasa_lerobot.envs.kitchens.appliances.kinds.microwave import Microwave
from robocasa_lerobot.envs.kitchens.appliances.kinds.oven import Oven
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stand_mixer import StandMixer
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Stove, Stovetop
from robocasa_lerobot.envs.kitchens.appliances.kinds.toaster import Toaster
from robocasa_lerobot.envs.kitchens.appliances.kinds.toaster_oven import ToasterOven
from robocasa_lerobot.envs.kitchens.appliances.records import SPLITS, ModelRecord, Size, generate
from robocasa_lerobot.errors import UnknownNameError

# By kind, else by category: the class that builds its models.
CLASSES: dict[str, type[Appliance]] = {
    "blender": Blender,
    "coffee_machine": CoffeeMachine,
    "dishwasher": Dishwasher,
    "electric_kettle": ElectricKettle,
    "fridge_bottom_freezer": BottomFreezerFridge,
    "fridge_french_door": FrenchDoorFridge,
    "fridge_side_by_side": SideBySideFridge,
    "sink": Sink,
    "microwave": Microwave,
    "oven": Oven,
    "stand_mixer": StandMixer,
    "stove": Stove,
    "stovetop": Stovetop,
    "toaster": Toaster,
    "toaster_oven": ToasterOven,
}


@functools.cache
def _models() -> dict[str, ModelRecord]:
    return {record.model_id: record for kind in KINDS for record in generate(kind)}


def categories() -> tuple[str, ...]:
    """The 12 categories, e.g. "fridge"."""
    return tuple(dict.fromkeys(kind.category for kind in KINDS))


def kinds() -> tuple[str, ...]:
    """The fixture types, e.g. "fridge_french_door"; most categories have one of their own name."""
    return tuple(kind.name for kind in KINDS)


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
    made = CLASSES[record.kind if record.kind in CLASSES else record.category]
    return made(name, record.size if size is None else size, pos, yaw, record=record)
