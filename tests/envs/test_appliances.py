"""The catalogue of appliances."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.kitchens.appliances.base import OPEN_FROM
from robocasa_lerobot.envs.kitchens.appliances.catalogue import (
    build_appliance,
    categories,
    kinds,
    model_of,
    models_in,
    models_of,
)
from robocasa_lerobot.envs.kitchens.appliances.finishes import finish, finish_names
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style
from robocasa_lerobot.errors import UnknownNameError
from robocasa_lerobot.gallery.appliance_pictures import appliance_pictures

# Inventory of RoboCasa365 (docs/robocasa.md, section 9).
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


def touched_box(model):
    """Corners of the box around all that can be touched, at rest."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for geom in np.flatnonzero(model.geom_contype):
        rotation, size = np.abs(data.geom_xmat[geom].reshape(3, 3)), model.geom_size[geom]
        across = np.sqrt(1 - np.clip(rotation[:, 2], 0, 1) ** 2)
        extent = {
            mujoco.mjtGeom.mjGEOM_BOX: rotation @ size,
            mujoco.mjtGeom.mjGEOM_CYLINDER: rotation[:, 2] * size[1] + across * size[0],
            mujoco.mjtGeom.mjGEOM_CAPSULE: rotation[:, 2] * size[1] + size[0],
        }[mujoco.mjtGeom(int(model.geom_type[geom]))]
        low, high = np.minimum(low, data.geom_xpos[geom] - extent), np.maximum(high, data.geom_xpos[geom] + extent)
    return low, high


@pytest.mark.parametrize("model_id", [r.model_id for kind in kinds() for r in models_of(kind)[:8]])
def test_models_fill_their_box_and_keep_to_it(model_id):
    fixture, model = compiled(model_id)
    low, high = touched_box(model)
    half = np.array(fixture.size) / 2
    category = fixture.record.category
    assert low[2] == pytest.approx(-half[2], abs=0.002)
    if category == "sink":  # its faucet stands behind and above it
        return
    # Handles and knobs stand out of the front; burners, grates and a guard out of a hob.
    assert (low[:1] > -half[:1] - 0.004).all()
    assert (high[:2] < half[:2] + 0.004).all()
    assert low[1] > -half[1] - 0.06
    if category != "stove":
        assert high[2] < half[2] + 0.003
        assert high[2] > half[2] - 0.02


@pytest.mark.parametrize("category", ["fridge", "dishwasher", "oven", "stove"])
def test_built_in_models_take_the_size_of_their_slot(category):
    for record in models_in(category)[::5]:
        size = tuple(1.06 * edge for edge in record.size)
        _, model = compiled(record.model_id, size=size)
        low, high = touched_box(model)
        half = np.array(size) / 2
        assert low[[0, 2]] == pytest.approx(-half[[0, 2]], abs=0.012)
        assert high[:2] == pytest.approx(half[:2], abs=0.012)


@pytest.mark.parametrize("model_id", SAMPLE)
def test_regions_lie_inside_and_those_of_burners_on_top(model_id):
    fixture, model = compiled(model_id)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    half = np.array(fixture.size) / 2
    for name, region in fixture.regions.items():
        if name in getattr(fixture, "burners", ()):
            floor = region.world(data, (0.0, 0.0, -region.half[2]))
            assert (np.abs(floor[:2]) < half[:2]).all()
            assert half[2] <= floor[2] < half[2] + 0.05
            continue
        for corner in np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T:
            point = region.world(data, corner * region.half)
            assert (np.abs(point) <= half + 1e-3).all(), (name, point, half)
            assert region.contains(data, region.world(data, 0.99 * corner * region.half))


@pytest.mark.parametrize("kind", kinds())
def test_initial_states_can_be_set(kind):
    fixture, model = compiled(models_of(kind)[0].model_id)
    data = mujoco.MjData(model)
    for share in (0.0, 0.5, 1.0):
        fixture.set_openness(data, share)
        for door in fixture.doors:
            assert fixture.share(data, door) == pytest.approx(share)
        assert fixture.is_open(data) == (share >= OPEN_FROM or not fixture.doors)
        assert fixture.is_closed(data) == (share == 0.0 or not fixture.doors)
    for rack in (*getattr(fixture, "racks", ()), *getattr(fixture, "sliding", ())):
        mujoco.mj_resetData(model, data)
        fixture.set_rack(data, 0.7, rack)
        assert fixture.state(data)[rack] == pytest.approx(0.7)
        assert fixture.is_open(data)


@pytest.mark.parametrize("model_id", [r.model_id for kind in kinds() for r in models_of(kind)[:3]])
def test_burners_take_every_level(model_id):
    fixture, model = compiled(model_id)
    if fixture.record.category != "stove":
        return
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for location in fixture.burners:
        for draw in (0.0, 0.5, 1.0):
            for level, reads in (("off", ("off",)), ("low", ("low",)), ("high", ("high",)), ("on", ("low", "high"))):
                fixture.set_burner(data, location, level, draw)
                assert fixture.burner_level(data, location) in reads, (level, draw)
        site = data.site(f"it_burner_on_{location}").xpos
        assert fixture.nearest_burner(data, site + np.array([0.01, 0.0, 0.1])) == (location, pytest.approx(0.01))


@pytest.mark.parametrize("kind", [k for k in kinds() if k.startswith("fridge")])
def test_fridges_have_usable_shelves_and_a_drawer(kind):
    for record in models_of(kind):
        fixture = build_appliance(record.model_id, "it", (0.0, 0.0, record.size[2] / 2))
        *_, second, highest = fixture.usable_shelves("fridge")
        assert fixture.regions[highest].center[2] > fixture.regions[second].center[2], record.model_id
        assert fixture.drawers


def test_a_mug_under_the_spout_is_told_from_one_beside_it():
    for record in models_of("coffee_machine")[:8]:
        fixture, model = compiled(record.model_id)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        place = np.array(fixture.place)
        assert fixture.under_spout(data, place)
        assert fixture.under_spout(data, place + np.array([0.03, 0.0, 0.09]))
        assert not fixture.under_spout(data, place + np.array([0.05, 0.0, 0.0]))
        assert not fixture.under_spout(data, place + np.array([0.0, 0.0, 0.11]))


@pytest.mark.render
@pytest.mark.parametrize("kind", kinds())
def test_states_can_be_seen(kind):
    pictures = appliance_pictures(models_of(kind)[0].model_id, size=96)
    first, *others = [picture.astype(int) for picture in pictures.values()]
    assert first.std() > 5
    for name, other in zip(list(pictures)[1:], others, strict=True):
        assert (np.abs(first - other).max(axis=-1) > 30).sum() >= 4, name


@pytest.mark.render
@pytest.mark.parametrize("kind", kinds())
def test_no_state_is_cut_off_at_the_edge_of_its_picture(kind):
    pictures = np.array([*appliance_pictures(models_of(kind)[-1].model_id, size=96).values()], dtype=int)
    background = np.median(pictures[:, :, [0, -1]], axis=(0, 2))  # of each row, from both sides
    there = np.abs(pictures - background[None, :, None]).max(axis=-1) > 40
    edges = [there[:, [0, -1]], there[:, :, [0, -1]]]
    assert not any(edge.any() for edge in edges)
    columns, rows = np.nonzero(there.any(axis=(0, 1)))[0], np.nonzero(there.any(axis=(0, 2)))[0]
    assert max(np.ptp(columns), np.ptp(rows)) > 96 / 2  # nor is the camera far away
