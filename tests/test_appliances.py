"""The catalogue of appliances."""

from __future__ import annotations

import mujoco
import pytest

from robocasa_lerobot.envs.scene.appliances.catalogue import (
    build_appliance,
    categories,
    kinds,
    model_of,
    models_in,
    models_of,
)
from robocasa_lerobot.envs.scene.appliances.finishes import finish, finish_names
from robocasa_lerobot.envs.scene.materials import MaterialPalette, load_style
from robocasa_lerobot.errors import UnknownNameError

# Inventory of RoboCasa365 (facts, benchmark).
COUNTS = {
    "blender": 22,
    "coffee_machine": 48,
    "dishwasher": 25,
    "electric_kettle": 25,
    "fridge": 50,
    "microwave": 50,
    "oven": 21,
    "sink": 49,
    "stand_mixer": 25,
    "stove": 50,
    "toaster": 44,
    "toaster_oven": 47,
}
MODELS = [record.model_id for category in categories() for record in models_in(category)]
SAMPLE = [record.model_id for kind in kinds() for record in models_of(kind)[:2]]


def test_counts_are_the_inventory():
    assert {category: len(models_in(category)) for category in categories()} == COUNTS
    assert len(MODELS) == len(set(MODELS)) == 456
    assert {f"fridge_{kind}" for kind in ("french_door", "side_by_side", "bottom_freezer")} < set(kinds())
    assert {"stove", "stove_wide", "stovetop"} < set(kinds())


def test_no_two_models_are_equal():
    seen = {}
    for model_id in MODELS:
        record = model_of(model_id)
        what = (record.kind, record.size, tuple(sorted(record.params.items())))
        assert what not in seen, (model_id, seen.get(what))
        seen[what] = model_id


@pytest.mark.parametrize("kind", kinds())
def test_splits_share_no_model(kind):
    pretrain, target = ({r.model_id for r in models_of(kind, split)} for split in ("pretrain", "target"))
    assert pretrain
    assert target
    assert not pretrain & target
    assert pretrain | target == {r.model_id for r in models_of(kind)}


def test_splits_share_no_texture_and_no_shade():
    for name in finish_names():
        pretrain, target = finish(name, "pretrain"), finish(name, "target")
        assert pretrain != target
        if pretrain.texture is not None:
            assert target.texture is not None
            assert pretrain.texture.file != target.texture.file


def test_unknown_models_are_named():
    with pytest.raises(UnknownNameError, match="microwave"):
        models_of("microwav")
    with pytest.raises(UnknownNameError, match="microwave_001"):
        build_appliance("microwave_0011", "microwave", (0, 0, 0))


def compiled(model_id, **kwargs):
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    fixture = build_appliance(model_id, "it", (0.0, 0.0, 0.0), **kwargs)
    fixture.build(spec, MaterialPalette(spec, load_style(1)))
    return fixture, spec.compile()


@pytest.mark.parametrize("model_id", SAMPLE)
def test_models_compile(model_id):
    _, model = compiled(model_id)
    assert model.ngeom > 0
