"""Robots and layouts: the files of others become named columns, bit for bit, and verify."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from convert_layouts import (
    OSC_POSE,
    composite,
    stored_actions,
    write_mimicgen,
    write_raw_collection,
    write_robocasa_v01,
    write_robosuite,
)
from convert_support import INSTRUCTION, SCENE, write_demos
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import contract
from robocasa_lerobot.convert.mapping.robots import choose_mapping
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.reading.demo_file import DemoFile
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings, make_plan
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.convert.writing.statistics import column
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

BOTH = ("robot0_right_", "robot0_left_")
TWO = ("robot0_", "robot1_")
POSE = ["end_effector_position", "end_effector_rotation"]


def _sides(names: list[str], *prefixes: str) -> list[str]:
    return [prefix + name for prefix in prefixes for name in names]


# robots, arms, environment, size of actions, expected parts of the action with their sizes
ROBOTS: dict[str, tuple[tuple[str, ...], dict[str, Any], int, dict[str, int]]] = {
    "one arm": (("robot0_",), {"robots": "Panda", "controller_configs": OSC_POSE}, 7,
                dict(zip([*POSE, "gripper_close"], (3, 3, 1), strict=True))),
    "one arm, 1.5": (("robot0_",), {"robots": ["Panda"], "controller_configs": composite("right")}, 7,
                     dict(zip([*POSE, "gripper_close"], (3, 3, 1), strict=True))),
    "positions only": (("robot0_",), {"robots": "Sawyer", "controller_configs": {"type": "OSC_POSITION"}}, 4,
                       {"end_effector_position": 3, "gripper_close": 1}),
    "joint velocities": (("robot0_",), {"robots": "Panda", "controller_configs": {"type": "JOINT_VELOCITY"}}, 8,
                         {"joint_velocity": 7, "gripper_close": 1}),
    "joint positions": (("robot0_",), {"robots": "Panda", "controller_configs": {"type": "JOINT_POSITION"}}, 8,
                        {"joint_position": 7, "gripper_close": 1}),
    "absolute joint positions": (
        ("robot0_",),
        {"robots": "Panda", "controller_configs": {"type": "JOINT_POSITION", "input_type": "absolute"}}, 8,
        {"joint_position_absolute": 7, "gripper_close": 1}),
    "absolute poses": (("robot0_",), {"robots": "Panda", "controller_configs": {**OSC_POSE, "control_delta": False}}, 7,
                       {"end_effector_position_absolute": 3, "end_effector_rotation_absolute": 3, "gripper_close": 1}),
    "absolute poses, 1.5": (
        ("robot0_",), {"robots": ["Panda"], "controller_configs": composite("right", input_type="absolute")}, 7,
        {"end_effector_position_absolute": 3, "end_effector_rotation_absolute": 3, "gripper_close": 1}),
    "variable impedance": (("robot0_",), {"robots": "Panda", "controller_configs": OSC_POSE}, 19, {"action": 19}),
    "no controller": (("robot0_",), {"robots": "Panda"}, 7, {"action": 7}),
    "two robots": (TWO, {"robots": ["Panda", "Sawyer"], "controller_configs": [OSC_POSE, OSC_POSE]}, 14,
                   dict.fromkeys(_sides([*POSE, "gripper_close"], *TWO), 0)),
    "two robots, one configuration": (TWO, {"robots": ["Panda", "Panda"], "controller_configs": composite("right")}, 14,
                                      dict.fromkeys(_sides([*POSE, "gripper_close"], *TWO), 0)),
    "two robots, other controllers": (
        TWO, {"robots": ["Panda", "Panda"], "controller_configs": [{"type": "OSC_POSITION"}, OSC_POSE]}, 11,
        {"robot0_end_effector_position": 3, "robot0_gripper_close": 1, "robot1_end_effector_position": 3,
         "robot1_end_effector_rotation": 3, "robot1_gripper_close": 1}),
    "both hands before 1.5": (BOTH, {"robots": "Baxter", "controller_configs": OSC_POSE}, 14,
                              dict.fromkeys(_sides([*POSE, "gripper_close"], "right_", "left_"), 0)),
    "both hands, a configuration each": (
        BOTH, {"robots": "Baxter", "controller_configs": [{"type": "OSC_POSITION"}, OSC_POSE]}, 11,
        {"right_end_effector_position": 3, "right_gripper_close": 1, "left_end_effector_position": 3,
         "left_end_effector_rotation": 3, "left_gripper_close": 1}),
    "both hands, 1.5": (BOTH, {"robots": ["Baxter"], "controller_configs": composite("right", "left")}, 14,
                        dict.fromkeys([*_sides(POSE, "right_", "left_"), "right_gripper_close", "left_gripper_close"],
                                      0)),
    "hands with fingers": (BOTH, {"robots": ["GR1ArmsOnly"], "controller_configs": composite("right", "left")}, 24,
                           {"action": 24}),
}  # fmt: skip


@pytest.mark.parametrize("case", ROBOTS)
def test_robots_are_recognised(case: str, tmp_path: Path) -> None:
    arms, environment, size, expected = ROBOTS[case]
    path = write_robosuite(tmp_path / "a.hdf5", arms, size, environment)
    with DemoFile(path) as file:
        demo = file.demo("demo_0")
        mapping = choose_mapping(file, demo)
        sizes = {part.name: part.size for part in mapping.action_parts}
        assert list(sizes) == list(expected)
        assert all(sizes[name] == count for name, count in expected.items() if count)
        assert mapping.actions(demo).tobytes() == demo.actions.tobytes()
        states = mapping.recorded_states(demo)
        assert states is not None
        with h5py.File(path) as raw:
            keys = [f"data/demo_0/obs/{arm}{end}" for arm in arms for end in ("eef_pos", "eef_quat", "gripper_qpos")]
            assert states.tobytes() == np.concatenate([raw[key][:] for key in keys], axis=1).tobytes()
    names = contract.component_names(mapping.state_parts)
    assert len(set(names)) == len(names) == 9 * len(arms)
    robots = environment["robots"]
    assert mapping.robot_type == (robots if isinstance(robots, str) else "+".join(robots))


def test_body_part_ordering_counts(tmp_path: Path) -> None:
    order = ["right", "right_gripper", "left", "left_gripper"]
    configuration = composite("right", "left") | {
        "composite_controller_specific_configs": {"body_part_ordering": order}
    }
    path = write_robosuite(tmp_path / "a.hdf5", BOTH, 14, {"robots": ["Baxter"], "controller_configs": [configuration]})
    with DemoFile(path) as file:
        mapping = choose_mapping(file, file.demo("demo_0"))
    assert [part.name for part in mapping.action_parts] == _sides([*POSE, "gripper_close"], "right_", "left_")


def test_two_arms_convert_and_verify(tmp_path: Path) -> None:
    environment = {"robots": ["Panda", "Panda"], "controller_configs": [OSC_POSE, OSC_POSE], "control_freq": 10}
    cameras = ("agentview", "robot0_eye_in_hand", "robot1_eye_in_hand", "birdview")
    path = write_robosuite(tmp_path / "a.hdf5", TWO, 14, environment, cameras=cameras)
    result = convert([path], tmp_path / "out", ConversionSettings(instruction="lift the pot"))
    assert result.cameras == cameras[:3]
    dataset = LeRobotDataset("local/x", root=tmp_path / "out", video_backend="pyav")
    assert (dataset.fps, dataset.meta.robot_type) == (10, "Panda+Panda")
    assert dataset.meta.features["action"]["names"][7:10] == ["robot1_eef_dx", "robot1_eef_dy", "robot1_eef_dz"]
    assert dataset[3]["task"] == "lift the pot"
    assert verify(tmp_path / "out", pictures_per_episode=None).passed


# Two of the smallest arms in robosuite's names, of which the second is turned.
_ARM = """
<body name="robot{i}_base" pos="{x} 0 0"><joint name="robot{i}_joint1" axis="0 0 1"/>
  <geom size="0.1" mass="1" rgba="0.5 {i} 0.2 1" group="1"/>
  <body name="robot{i}_right_hand" pos="0.3 0 0.5" quat="0.8 0.6 0 0"><geom size="0.05" mass="1" group="1"/>
    <site name="gripper{i}_right_grip_site" pos="0 0 0.1"/>
    <body><joint name="gripper{i}_right_finger_joint1" type="slide"/><geom size="0.01" mass="1"/></body>
  </body>
</body>"""
TWO_ARMS = f"""<mujoco><worldbody><light pos="0 0 4"/><camera name="agentview" pos="2 0 1" xyaxes="0 1 0 -0.3 0 1"/>
<geom type="plane" size="4 4 0.1" rgba="0.4 0.4 0.6 1" group="1"/>{_ARM.format(i=0, x=0)}{_ARM.format(i=1, x=1)}
</worldbody></mujoco>"""


@pytest.mark.render
def test_states_of_two_arms_are_computed_from_the_scene(tmp_path: Path) -> None:
    path = tmp_path / "a.hdf5"
    rng = np.random.default_rng(0)
    states = np.concatenate([np.arange(4)[:, None] / 20, rng.normal(size=(4, 8))], axis=1)
    with h5py.File(path, "w") as file:
        demo = file.create_group("data/demo_0")
        file["data"].attrs["env_info"] = json.dumps({"robots": ["A", "B"], "env_name": "TwoArmLift"})
        demo.attrs["model_file"] = TWO_ARMS
        demo["states"], demo["actions"] = states, rng.normal(size=(4, 6))
    convert([path], tmp_path / "out", ConversionSettings(image_size=32))
    assert verify(tmp_path / "out").passed
    state = column(tmp_path / "out", "observation.state")
    assert state.shape == (4, 16)
    for arm, x in ((0, 0.0), (1, 1.0)):
        yaw, finger = states[:, 1 + 2 * arm], states[:, 2 + 2 * arm]
        # The hand is turned by 2 acos 0.8 about x, so that its grip site lies 0.096 m to the side, 0.028 m up.
        side, up = -0.1 * np.sin(2 * np.arccos(0.8)), 0.1 * np.cos(2 * np.arccos(0.8))
        expected = np.stack(
            [x + 0.3 * np.cos(yaw) - side * np.sin(yaw), 0.3 * np.sin(yaw) + side * np.cos(yaw), 0 * yaw + 0.5 + up],
            axis=1,
        )
        np.testing.assert_allclose(state[:, 8 * arm : 8 * arm + 3], expected, atol=1e-12)
        assert np.array_equal(state[:, 8 * arm + 7], finger)


def test_arms_without_observations_are_named_as_in_their_scene(tmp_path: Path) -> None:
    scene = _ARM.format(i=0, x=0) + _ARM.format(i=0, x=1).replace("right", "left").replace("robot0_left_base", "b")
    scene = scene.replace("_hand", "_eef").replace('"robot0_base"', '"a"', 1).replace("robot0_joint1", "j", 1)
    path = tmp_path / "a.hdf5"
    with h5py.File(path, "w") as file:
        demo = file.create_group("data/demo_0")
        demo.attrs["model_file"] = f"<mujoco><worldbody>{scene}</worldbody></mujoco>"
        demo["actions"] = np.zeros((2, 3))
    with DemoFile(path) as file:
        mapping = choose_mapping(file, file.demo("demo_0"))
    assert [arm.hand_body for arm in mapping.arms] == ["robot0_right_eef", "robot0_left_eef"]
    assert [arm.joints for arm in mapping.arms] == [("gripper0_right_finger_joint1",), ("gripper0_left_finger_joint1",)]


@pytest.fixture(scope="module")
def v01(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_robocasa_v01(tmp_path_factory.mktemp("v01") / "demo_im128.hdf5")


def test_robocasa_v01_with_absolute_actions_extra_columns_and_another_size(v01: Path, tmp_path: Path) -> None:
    extras = ("obs/object", "action_dict/rel_rot_6d", "rewards", "dones")
    settings = ConversionSettings(action_key="actions_abs", extra_columns=extras, image_size=96, filter_key="train")
    result = convert([v01], tmp_path / "out", settings)
    assert result.num_episodes == 3
    assert verify(tmp_path / "out", pictures_per_episode=None).passed
    dataset = LeRobotDataset("local/x", root=tmp_path / "out", video_backend="pyav")
    assert dataset.meta.features["action"]["names"][5:11] == ["eef_x", "eef_y", "eef_z", "eef_ax", "eef_ay", "eef_az"]
    names = ("demo_0", "demo_1", "demo_2")
    assert column(tmp_path / "out", "action").tobytes() == stored_actions(v01, names, "actions_abs").tobytes()
    with h5py.File(v01) as file:
        for key in extras:
            stored = column(tmp_path / "out", "extra." + key.replace("/", "."))
            source = np.concatenate([file[f"data/{name}/{key}"][:] for name in names])
            assert np.array_equal(stored.reshape(source.shape), source)
    item = dataset[7]
    assert item["extra.obs.object"].shape == (14,)
    assert item[contract.IMAGE_KEYS[0]].shape == (3, 96, 96)


def test_a_changed_extra_column_is_noticed(v01: Path, tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    out = tmp_path / "out"
    convert([v01], out, ConversionSettings(extra_columns=("obs/object",), demos="demo_0", image_size=16))
    file = next((out / "data").glob("*/*.parquet"))
    table = pq.read_table(file)
    where = table.schema.get_field_index("extra.obs.object")
    values = table.column(where).to_pylist()
    values[3][2] += 1e-9
    pq.write_table(
        table.set_column(where, table.schema.field(where), pa.array(values, table.schema.field(where).type)), file
    )
    failed = [check.name for check in verify(out).checks if not check.passed]
    assert failed == ["extra columns"]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"extra_columns": ("obs/objct",)}, "'obs/object'"),
        ({"extra_columns": ("/etc/passwd",)}, "below an episode"),
        ({"extra_columns": ("a/../b",)}, "below an episode"),
        ({"extra_columns": ("rewards", "rewards")}, "once"),
        ({"action_key": "action_abs"}, "'actions_abs'"),
        ({"action_key": "actions_abs", "mapping": "{}"}, "exclude each other"),
        ({"instruction": "pick up the {object}", "replace_instruction": True}, "Did you mean 'obj'"),
        ({"replace_instruction": True}, "nothing to take instead"),
        ({"instruction": "pick up the {obj"}, "expected"),
        ({"instruction": "{obj.__class__}"}, "a name in braces"),
        ({"instruction": "{obj!r}"}, "a name in braces"),
        ({"instruction": "{}"}, "a name in braces"),
    ],
)
def test_mistakes_are_named(v01: Path, fields: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=message):
        make_plan([v01], ConversionSettings(**fields))


@pytest.mark.parametrize(
    ("text", "replaces", "expected", "source"),
    [
        (None, False, INSTRUCTION, "ep_meta.lang"),
        ("pick the {obj} from the {sink}", False, INSTRUCTION, "ep_meta.lang"),
        ("pick the {obj} from the {sink}", True, "pick the hot dog from the sink main group", "--instruction template"),
        ("{task} {layout_id}", True, "pn p counter to sink 3", "--instruction template"),
        ("a {{b}}", True, "a {b}", "--instruction"),
    ],
)
def test_instructions(v01: Path, text: str | None, replaces: bool, expected: str, source: str) -> None:
    from robocasa_lerobot.convert.mapping.instruction import instruction_of

    with DemoFile(v01) as file:
        found = instruction_of(file.demo("demo_1"), file, text, replaces)
    assert (found.text, found.source) == (expected, source)


def test_template_field_that_one_episode_lacks_rejects_only_it(tmp_path: Path) -> None:
    path = write_robocasa_v01(tmp_path / "a.hdf5", (4, 5, 3, 3), size=32)
    with h5py.File(path, "a") as file:
        file["data/demo_1"].attrs["ep_meta"] = json.dumps({"lang": "x"})
    settings = ConversionSettings(instruction="wash the {obj}", replace_instruction=True)
    result = convert([path], tmp_path / "out", settings)
    assert [line["source_demo"] for line in result.rejected] == ["demo_1"]
    assert "unknown field 'obj'" in result.rejected[0]["reason"]
    assert result.instruction_sources == {"--instruction template": 3}
    assert verify(tmp_path / "out").passed


def test_nothing_says_what_the_robot_was_told(tmp_path: Path) -> None:
    path = write_demos(tmp_path / "a.hdf5", (4,), images=16, instruction=None)
    with h5py.File(path, "a") as file:
        del file["data"].attrs["env"], file["data"].attrs["env_args"]
    with pytest.raises(UserError, match="--instruction"):
        make_plan([path], ConversionSettings())


def test_mimicgen_keeps_where_an_episode_comes_from(tmp_path: Path) -> None:
    convert([write_mimicgen(tmp_path / "a.hdf5")], tmp_path / "out", ConversionSettings())
    lines = read_jsonl(tmp_path / "out" / META_FOLDER / "episodes.jsonl")
    assert lines[1]["mimicgen"] == {"source_demos": [8, 3], "segments": [[8, 4], [3, 1]]}
    assert verify(tmp_path / "out").passed


@pytest.mark.render
def test_raw_collection_from_demo_1(tmp_path: Path) -> None:
    path = write_raw_collection(tmp_path / "a.hdf5")
    result = convert([path], tmp_path / "out", ConversionSettings(image_size=32))
    lines = read_jsonl(tmp_path / "out" / META_FOLDER / "episodes.jsonl")
    assert [line["source_demo"] for line in lines] == ["demo_1", "demo_2"]
    assert result.num_frames == 11
    assert verify(tmp_path / "out").passed


def test_twelve_numbers_alone_make_no_panda_omron(tmp_path: Path) -> None:
    """A Panda with a hand of six joints has actions as long as PandaOmron's."""
    path = write_robosuite(tmp_path / "a.hdf5", ("robot0_",), 12, {"robots": ["PandaDexRH"]}, fingers=12)
    with h5py.File(path, "a") as file:
        for name in ("demo_0", "demo_1"):
            file["data"][name].attrs["model_file"] = SCENE.replace("mobilebase0_center", "nothing")
    with DemoFile(path) as file:
        mapping = choose_mapping(file, file.demo("demo_0"))
    assert (mapping.robot_type, mapping.base_site) == ("PandaDexRH", "")
