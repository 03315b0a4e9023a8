"""Objects: the catalogue beside the facts, instances and splits, shapes that rest, hold things and can be grasped."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from grasping_trial import GripperTrial, try_instance

from robocasa_lerobot.demos.planning.grasps import grasp_poses
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style, style_ids
from robocasa_lerobot.envs.objects import catalogue
from robocasa_lerobot.envs.objects.draft import FORMS
from robocasa_lerobot.envs.objects.forms import find_form
from robocasa_lerobot.envs.objects.shapes import add_object
from robocasa_lerobot.envs.physics.options import apply_simulation_options
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.build import LIQUIDS, build_scene
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.gallery.object_pictures import object_pictures

INDICES = range(catalogue.INSTANCES_PER_CATEGORY)
NAMES = tuple(catalogue.CATEGORIES)
RESULTS = Path(__file__).parents[2] / "benchmarks" / "results" / "grasps.json"
# Most solids of one object: contacts cost time.
MOST_SOLIDS, MOST_TRIANGLES = 20, 1500


def scene_with(*items: catalogue.Instance) -> mujoco.MjSpec:
    """A table top at z = 0 and objects `obj0`, `obj1`, ... at the origin."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    apply_simulation_options(spec)
    spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_BOX, size=[2, 2, 0.1], pos=[0, 0, -0.1])
    palette = MaterialPalette(spec, load_style(style_ids()[0]))
    for index, item in enumerate(items):
        add_object(spec, palette, f"obj{index}", item)
    return spec


def item_of(name: str, index: int = 0) -> catalogue.Instance:
    return catalogue.instance(catalogue.CATEGORIES[name], index)


def published_groups(shared: Path) -> tuple[dict[str, set[str]], set[str]]:
    """Groups and property lists of the facts by name, and what is not graspable."""
    text = (shared / "facts" / "robocasa.md").read_text()
    section = text[text.index("Categories 198") : text.index("FixtureType enum")]
    groups = {
        match[1]: set(match[2].split())
        for line in section.split("\n")
        for match in re.finditer(r"(?:^- |\| )([a-z_]+)(?: \d+)?: ([a-z_ ]+?)(?= \||$|\s*$)", line)
    }
    found = re.search(r"not graspable 41: (.*)", section)
    assert found is not None
    return groups, set(found[1].split())


def test_categories_agree_with_the_published_ones(shared):
    groups, not_graspable = published_groups(shared)
    published = set().union(*groups.values())
    assert len(published) == 198
    ours = {name for name, category in catalogue.CATEGORIES.items() if not category.added}
    assert ours == published
    assert len(catalogue.CATEGORIES) >= 210
    for name in ("dishwashable", "cookable", "microwavable"):
        assert {n for n in ours if name in catalogue.CATEGORIES[n].properties} == groups.pop(name)
    assert {n for n in ours if not catalogue.CATEGORIES[n].graspable} == not_graspable
    untyped = groups.pop("untyped")
    for name, members in groups.items():
        assert {c.name for c in catalogue.pool((name,))} == members, name
    assert all(not catalogue.CATEGORIES[name].groups for name in untyped)
    assert len(catalogue.pool(("any",))) == 198
    assert [c.name for c in catalogue.pool(("blender_lid",))] == ["blender_lid"]
    assert len([c for c in catalogue.categories_of("food") if not c.added]) == 102
    assert len([c for c in catalogue.categories_of("in_container") if not c.added]) == 117


def test_the_newer_categories_and_those_of_the_tasks_exist(shared):
    text = (shared / "facts" / "benchmark.md").read_text()
    found = re.search(r"57 new categories: (.*)\.", text)
    assert found is not None
    newer = [name.replace(" ", "_") for name in found[1].split(", ")]
    assert len(newer) == 57
    assert {n for n in newer if n not in catalogue.CATEGORIES} == {"non-electric_kettle"}  # kettle_non_electric
    words: set[str] = set()
    for line in (shared / "facts" / "task_blueprints.jsonl").read_text().splitlines():
        for wanted in json.loads(line)["objects"]:
            head = re.sub(r"\(.*?\)", "", wanted["category"])
            words |= {w.strip().lstrip("-") for w in re.split(r"[,|]| or | OR ", head)}
    # What the blueprints say in words is not a name; every single word of them must be one.
    names = {w for w in words if re.fullmatch(r"[a-z_]+", w)} - {"kettle"}
    assert len(names) > 100
    assert names <= set(catalogue.GROUPS), names - set(catalogue.GROUPS)


def test_splits_share_no_instance_and_cover_all():
    pretrain, target = (set(catalogue.split_indices(s)) for s in catalogue.SPLITS)
    assert not pretrain & target
    assert pretrain | target == set(INDICES)
    assert len(pretrain) == max(len(INDICES) - 5, -(-len(INDICES) // 2))
    assert min(len(pretrain), len(target)) >= 4
    assert len(INDICES) >= 8
    with pytest.raises(UnknownNameError, match="target"):
        catalogue.split_indices("targets")
    with pytest.raises(UnknownNameError, match="fruit"):
        catalogue.categories_of("fruits")


@pytest.mark.parametrize("name", NAMES)
def test_instances_differ_and_are_what_they_say(name):
    items = [item_of(name, index) for index in INDICES]
    assert len({item.own_size for item in items}) == len(INDICES)
    assert len({item.rgba for item in items}) == len(INDICES)
    category = catalogue.CATEGORIES[name]
    for item in items:
        assert all(0.004 < s <= bound + 1e-4 for s, bound in zip(item.size, category.largest, strict=True))
    shape = catalogue.model_of(items[3])
    assert 1 <= len(shape.solids) <= MOST_SOLIDS
    assert 8 <= shape.triangles <= MOST_TRIANGLES
    assert len(shape.png) < 12_000
    # The bounding box of what is seen and what collides is the size that the instance states.
    seen = [
        [float(word) for word in line.split()[1:]]
        for text in shape.meshes.values()
        for line in text.decode().splitlines()
        if line.startswith("v ")
    ]
    points = np.concatenate([np.array(seen), *(s.cloud() for s in shape.solids)])
    assert np.abs(points.min(axis=0) + np.array(items[3].size) / 2).max() < 1e-3
    assert np.abs(points.max(axis=0) - np.array(items[3].size) / 2).max() < 1e-3
    # Nothing is seen below what it stands on.
    assert min(v[2] for v in seen) > min(float(s.cloud()[:, 2].min()) for s in shape.solids) - 1e-4


def test_every_form_is_used_and_a_misspelt_one_is_named():
    find_form("apple")
    assert {c.shape for c in catalogue.CATEGORIES.values()} == set(FORMS)
    with pytest.raises(UnknownNameError, match="apple"):
        find_form("aple")


def rests(name: str, index: int) -> str:
    """Why an instance does not rest within 1 s of being dropped from 5 mm; empty if it does."""
    item = item_of(name, index)
    model = scene_with(item).compile()
    data = mujoco.MjData(model)
    data.joint("obj0_joint0").qpos[2] = item.size[2] / 2 + 0.005
    mujoco.mj_step(model, data, 250)
    deepest = 0.0
    for _ in range(250):
        mujoco.mj_step(model, data)
        deepest = max([deepest, *(-contact.dist for contact in data.contact)])
    turn = data.body("obj0").xmat.reshape(3, 3)
    after = data.joint("obj0_joint0").qpos.copy()
    mujoco.mj_step(model, data, 250)
    faults = {
        "moved": np.linalg.norm(after[:2]) > 0.01,
        "fell over": turn[2, 2] < np.cos(np.radians(10)),
        "sank or rose": abs(after[2] - item.size[2] / 2) > 0.005,
        "penetrates": deepest > 0.002,
        "does not settle": np.linalg.norm(data.joint("obj0_joint0").qpos[:3] - after[:3]) > 0.002,
        "weighs nothing": model.body("obj0").mass[0] < 0.004,
    }
    return ", ".join(fault for fault, true in faults.items() if true)


@pytest.mark.parametrize("name", NAMES[::4])
def test_objects_rest_where_they_are_put(name):
    assert rests(name, NAMES.index(name) % len(INDICES)) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_every_instance_rests_where_it_is_put(name):
    faults = {index: rests(name, index) for index in INDICES}
    assert not any(faults.values()), faults


HOLLOW = (
    *("cup", "mug", "bowl", "pan", "pot", "saucepan", "basket", "colander"),
    *("glass_cup", "tupperware", "pitcher", "jug_wide_opening", "measuring_cup"),
)
FLAT = ("plate", "tray", "oven_tray", "baking_sheet", "cutting_board", "placemat", "digital_scale")


@pytest.mark.parametrize("name", HOLLOW + FLAT)
def test_things_can_be_put_into_what_is_hollow_and_onto_what_is_flat(name):
    vessel, load = item_of(name, 2), item_of("sugar_cube", 1)
    interior = vessel.interior
    assert interior is not None
    model = scene_with(vessel, load).compile()
    data = mujoco.MjData(model)
    data.joint("obj0_joint0").qpos[2] = vessel.size[2] / 2
    start = np.array(interior.center) + np.array([0, 0, vessel.size[2] / 2])
    data.joint("obj1_joint0").qpos[:3] = start
    mujoco.mj_step(model, data, 600)
    place = data.body("obj1").xpos - data.body("obj0").xpos
    assert np.abs(place[:2] - interior.center[:2]).max() < max(interior.half[:2])
    bottom = place[2] - load.size[2] / 2 + vessel.size[2] / 2
    assert bottom > -0.001
    if name in HOLLOW:
        assert place[2] < vessel.size[2] / 2, "it does not go in"
    assert np.abs(data.joint("obj1_joint0").qvel).max() < 0.05


def test_a_sample_has_what_was_asked_for():
    rng = np.random.default_rng(0)
    for _ in range(100):
        item = catalogue.sample(
            rng,
            ("food", "drink"),
            "target",
            exclude=frozenset({"meat", "apple"}),
            properties=("graspable", "washable", "fridgable"),
            max_size=(0.2, None, 0.1),
        )
        assert {"graspable", "washable", "fridgable"} <= item.category.properties
        assert item.category.name != "apple"
        assert "meat" not in item.category.groups
        assert item.size[0] <= 0.2
        assert item.size[2] <= 0.1
        assert item.index in catalogue.split_indices("target")
    drawn = {catalogue.sample(rng, ("any",), "pretrain").category.name for _ in range(2000)}
    assert len(drawn) > 190
    assert drawn == {c.name for c in catalogue.CATEGORIES.values() if not c.added}
    with pytest.raises(UserError, match="widen"):
        catalogue.sample(rng, ("fruit",), "target", properties=("dishwashable",))
    with pytest.raises(UnknownNameError, match="fridgable"):
        catalogue.sample(rng, ("fruit",), "target", properties=("fridgeable",))
    with pytest.raises(UserError, match="positive"):
        catalogue.scaled(item, (1.0, -1.0, 1.0))


@pytest.mark.parametrize("name", ["pan", "bottled_water", "banana", "cutting_board", "mug"])
def test_scaled_and_upright_objects_have_the_size_they_say(name):
    rng = np.random.default_rng(1)
    for scale, upright in (((1.5, 1.5, 0.75), False), (0.8, False), (1.0, True), ((1.2, 1.0, 1.0), True)):
        item = catalogue.sample(rng, (name,), "pretrain", object_scale=scale, rotate_upright=upright)
        if upright:
            assert item.size[2] == max(item.size)
        model = scene_with(item).compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for geom in range(1, model.ngeom):
            if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
                continue
            mesh = model.geom_dataid[geom]
            start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            points = model.mesh_vert[start : start + count] @ data.geom_xmat[geom].reshape(3, 3).T
            low = np.minimum(low, (points + data.geom_xpos[geom]).min(axis=0))
            high = np.maximum(high, (points + data.geom_xpos[geom]).max(axis=0))
        assert np.all(high - low <= np.array(item.size) + 2e-3)
        assert np.abs((high - low) - item.size).max() < 0.012


def test_a_saucepan_with_a_lid_names_its_lid_and_liquids_only_look():
    item = catalogue.scaled(item_of("saucepan_with_lid", 4), 0.9)
    lid = catalogue.auxiliary(item)
    assert lid is not None
    assert (lid.category.name, lid.index, lid.scale) == ("saucepan_lid", 4, item.scale)
    for index in range(catalogue.INSTANCES_PER_CATEGORY):
        pan = item_of("saucepan_with_lid", index)
        lid = catalogue.auxiliary(pan)
        assert lid is not None
        assert lid.size[0] / pan.size[1] == pytest.approx(1.06, abs=1e-3)  # it lies on the rim all round
    assert catalogue.auxiliary(item_of("apple")) is None
    spec = mujoco.MjSpec()
    add_object(
        spec, MaterialPalette(spec, load_style(style_ids()[0])), "mug", item_of("mug"), liquid=(0.3, 0.15, 0.05, 1)
    )
    model = spec.compile()
    liquid = model.geom("mug_liquid")
    assert liquid.contype[0] == 0
    assert liquid.conaffinity[0] == 0


@pytest.mark.parametrize("name", ["cup", "jug", "mug", "pan", "pot", "saucepan", "saucepan_with_lid", "tupperware"])
def test_liquids_have_the_shape_of_what_holds_them(name):
    spec = mujoco.MjSpec()
    add_object(spec, MaterialPalette(spec, load_style(style_ids()[0])), name, item_of(name), liquid=(0.7, 0.8, 0.9, 1))
    box, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
    assert spec.compile().geom(f"{name}_liquid").type == (box if name == "tupperware" else cylinder)


@pytest.mark.slow
def test_the_cup_of_a_task_shows_the_coffee_that_is_in_it():
    scene = build_scene(get_task("MakeIcedCoffee"), "target", 0)
    liquid = scene.model.geom("cup_liquid")
    assert scene.model.mat_rgba[liquid.matid[0]] == pytest.approx(LIQUIDS["coffee"], abs=0.01)
    assert liquid.contype[0] == liquid.conaffinity[0] == 0


def test_two_of_a_kind_share_their_meshes_and_a_model_is_a_pure_function():
    first, second = (scene_with(item_of("kiwi", 3), item_of("kiwi", 3)) for _ in range(2))
    assert first.to_xml() == second.to_xml()
    one = scene_with(item_of("kiwi", 3))
    assert len(first.meshes) == len(one.meshes)
    assert set(first.assets) == set(one.assets)
    for name, content in one.assets.items():
        assert first.assets[name] == content


@pytest.mark.parametrize("name", ["apple", "mug", "pan", "wine", "sponge", "banana"])
def test_grasp_poses_keep_the_fingers_off_the_table(name):
    item = item_of(name)
    poses = grasp_poses(item, PANDA_OMRON.gripper)
    assert 1 <= len(poses) <= 16
    for pose in poses:
        assert pose.width < 0.0785
        assert np.allclose(pose.rotation.T @ pose.rotation, np.eye(3), atol=1e-9)
        assert np.allclose(pose.rotation[:, 2], [0, 0, -1])
        assert pose.position[2] - 0.014 > -item.size[2] / 2


@pytest.mark.parametrize("name", ["apple", "mug", "fish", "milk", "saucepan", "sausage"])
def test_a_gripper_lifts_and_holds(name):
    assert try_instance(name, 6).lifted


@pytest.mark.parametrize("name", ["apple", "mug"])
def test_a_gripper_that_closes_beside_an_object_lifts_nothing(name):
    trial = GripperTrial(item_of(name, 6))
    pose = trial.poses()[0]
    assert trial.lifts(pose)
    assert not trial.lifts(replace(pose, position=pose.position + np.array([0.12, 0.0, 0.0])))
    assert not trial.lifts(replace(pose, position=pose.position + np.array([0.0, 0.0, 0.12])))


def test_the_published_grasps_meet_the_aim():
    result = json.loads(RESULTS.read_text())
    graspable = {name for name, category in catalogue.CATEGORIES.items() if category.graspable}
    assert set(result["categories"]) == graspable
    assert all(c["instances"] == len(INDICES) for c in result["categories"].values())
    assert result["ratios"]["lifted"] >= 0.95
    assert min(c["share"] for c in result["categories"].values()) >= 0.60


@pytest.mark.render
def test_contact_sheets_show_something_in_every_tile(tmp_path):
    from PIL import Image

    (sheet,) = object_pictures(tmp_path, ["apple", "fork", "cereal"], indices=(0, 1), tile=48, columns=3, title=False)
    pixels = np.asarray(Image.open(sheet)).astype(int)
    assert pixels.shape == (96, 144, 3)
    for row in range(2):
        for column in range(3):
            tile = pixels[row * 48 : (row + 1) * 48, column * 48 : (column + 1) * 48]
            assert np.abs(tile - tile[-1, 0]).sum(axis=2).max() > 60
