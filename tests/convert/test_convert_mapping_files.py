"""Mapping files: layouts of others described in YAML convert and verify, and every mistake in one is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import yaml
from convert_layouts import write_aloha, write_libero
from convert_support import INSTRUCTION, moving_pictures, write_demos
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot.convert.mapping.custom import EXAMPLE, FIXED_ARM_EXAMPLE, parse_mapping, read_mapping
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.settings import ConversionSettings, make_plan
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.convert.writing.statistics import column
from robocasa_lerobot.errors import UserError

ALOHA: dict[str, Any] = {
    "robot_type": "ALOHA",
    "fps": 50,
    "episodes": "/",
    "state": {
        "left": {"key": "observations/qpos", "slice": [0, 7]},
        "right": {"key": "observations/qpos", "slice": [7, 14]},
    },
    "action": {"arms": "action"},
    "cameras": {"top": "observations/images/top", "wrist": {"key": "observations/images/left_wrist", "flip": "none"}},
    "instruction": "put the lid onto the cup",
}
LIBERO: dict[str, Any] = {
    "robot_type": "Panda",
    "fps": 20,
    "state": {"eef": "obs/ee_states", "gripper": {"key": "obs/gripper_states", "components": ["left", "right"]}},
    "action": {"motion": {"key": "actions", "slice": [0, 6]}, "gripper_close": {"key": "actions", "slice": [6, 7]}},
    "cameras": {"agentview": {"key": "obs/agentview_rgb", "flip": "vertical"}},
    "instruction": {"attribute": "problem_info", "field": "language_instruction"},
}


def _mapping(tmp_path: Path, content: Any) -> str:
    file = tmp_path / "mapping.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False))
    return read_mapping(file)


def test_a_mapping_file_for_files_of_one_episode(tmp_path: Path) -> None:
    files = [write_aloha(tmp_path / f"episode_{i}.hdf5", 6 + i) for i in range(2)]
    convert(
        files,
        tmp_path / "out",
        ConversionSettings(mapping=_mapping(tmp_path, ALOHA), extra_columns=("observations/qvel",)),
    )
    report = verify(tmp_path / "out", pictures_per_episode=None)
    assert report.passed, report.as_json()
    dataset = LeRobotDataset("local/x", root=tmp_path / "out", video_backend="pyav")
    assert (dataset.fps, dataset.num_episodes, dataset.num_frames) == (50, 2, 13)
    assert dataset[12]["task"] == ALOHA["instruction"]
    assert dataset.meta.features["observation.state"]["names"][7] == "right_0"
    with h5py.File(files[1]) as file:
        assert np.array_equal(column(tmp_path / "out", "action")[6:], file["action"][:].astype(np.float64))


def test_a_mapping_file_with_slices_flips_and_recorded_language(tmp_path: Path) -> None:
    path = write_libero(tmp_path / "libero.hdf5")
    result = convert([path], tmp_path / "out", ConversionSettings(mapping=_mapping(tmp_path, LIBERO)))
    assert result.instruction_sources == {"problem_info.language_instruction": 2}
    assert verify(tmp_path / "out", pictures_per_episode=None).passed
    dataset = LeRobotDataset("local/x", root=tmp_path / "out", video_backend="pyav", return_uint8=True)
    assert dataset[0]["task"] == INSTRUCTION
    with h5py.File(path) as file:
        upright = file["data/demo_0/obs/agentview_rgb"][2][::-1]
    decoded = dataset[2]["observation.images.agentview"].permute(1, 2, 0).numpy()
    assert np.abs(decoded.astype(int) - upright).mean() < 6


@pytest.mark.render
def test_a_mapping_file_may_render(tmp_path: Path) -> None:
    path = write_demos(tmp_path / "a.hdf5", (4,))
    content = {
        "robot_type": "Mine", "fps": 20, "state": {"base": "obs/robot0_base_pos"}, "action": {"all": "actions"},
        "cameras": {"robot0_agentview_left": "render"},
    }  # fmt: skip
    result = convert([path], tmp_path / "out", ConversionSettings(mapping=_mapping(tmp_path, content), image_size=32))
    assert result.instruction_sources == {"ep_meta.lang": 1}
    assert verify(tmp_path / "out").passed


def _with(content: dict[str, Any], **changes: Any) -> dict[str, Any]:
    return {key: value for key, value in {**content, **changes}.items() if value is not None}


MISTAKES: dict[str, tuple[dict[str, Any], str]] = {
    "unknown key": (_with(LIBERO, robot="Panda"), "'robot_type'"),
    "no state": (_with(LIBERO, state=None), "no 'state'"),
    "empty cameras": (_with(LIBERO, cameras={}), "no 'cameras'"),
    "fps in words": (_with(LIBERO, fps="fast"), "fps is 'fast'"),
    "half a frame": (_with(LIBERO, fps=12.5), "fps is 12.5"),
    "no such dataset": (_with(LIBERO, state={"eef": "obs/ee_state"}), "'obs/ee_states'"),
    "too long a slice": (
        _with(LIBERO, state={"eef": {"key": "obs/ee_states", "slice": [0, 9]}}),
        "0 to 9 of obs/ee_st",
    ),
    "no slice": (_with(LIBERO, state={"eef": {"key": "obs/ee_states", "slice": [3, 3]}}), r"\[3, 3\]"),
    "other components": (_with(LIBERO, state={"eef": {"key": "obs/ee_states", "components": ["x"]}}), "names 1 comp"),
    "unknown part key": (_with(LIBERO, state={"eef": {"keys": "obs/ee_states"}}), "'key'"),
    "outside the episode": (_with(LIBERO, state={"eef": "/data/demo_1/obs/ee_states"}), "below an episode"),
    "up and away": (_with(LIBERO, cameras={"a": "../demo_1/obs/agentview_rgb"}), "below an episode"),
    "unknown flip": (_with(LIBERO, cameras={"a": {"key": "obs/agentview_rgb", "flip": "vertically"}}), "'vertical'"),
    "camera that is none": (_with(LIBERO, cameras={"a": "obs/ee_states"}), "ee_states"),
    "no such camera": (_with(LIBERO, cameras={"a": "obs/front_rgb"}), "unknown camera"),
    "no such episodes": (_with(LIBERO, episodes="data/episode_*"), "data/episode_*"),
    "no such group": (_with(LIBERO, episodes="demos/demo_*"), "no group 'demos'"),
    "stars everywhere": (_with(LIBERO, episodes="*/demo_*"), "last name only"),
    "field of nothing": (_with(LIBERO, instruction={"field": "x"}), "attribute is missing"),
    "no such attribute": (_with(LIBERO, instruction={"attribute": "problem"}), "no attribute 'problem'"),
    "no such field": (_with(LIBERO, instruction={"attribute": "problem_info", "field": "x"}), "problem_info.x"),
    "no such text": (_with(LIBERO, instruction={"dataset": "language"}), "no text 'language'"),
    "no mapping": ({}, "expected names with values"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_in_a_mapping_file_are_named(case: str, tmp_path: Path) -> None:
    content, message = MISTAKES[case]
    path = write_libero(tmp_path / "libero.hdf5")
    with pytest.raises(UserError, match=message.replace("*", r"\*")):
        make_plan([path], ConversionSettings(mapping=_mapping(tmp_path, content)))


def test_the_documented_example_parses(tmp_path: Path) -> None:
    layout = parse_mapping(_mapping(tmp_path, yaml.safe_load(EXAMPLE)))
    assert layout.robot is not None
    assert layout.robot.cameras == ("top", "wrist", "overview")
    assert layout.pictures is not None
    assert [name for name, _ in layout.pictures] == ["top", "wrist"]
    assert replace(layout, robot=None).episodes == "/"


def test_the_documentation_shows_the_same_example() -> None:
    text = (Path(__file__).parents[2] / "docs" / "convert.md").read_text(encoding="utf-8")
    assert EXAMPLE in text


def test_a_fixed_arm_becomes_data_that_mix_with_the_mobile_robots(tmp_path: Path) -> None:
    from robocasa_lerobot import contract
    from robocasa_lerobot.data.fake import write_fake_dataset
    from robocasa_lerobot.data.mixture import MixtureDataset
    from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig

    rng = np.random.default_rng(0)
    sizes = {"eef_pos": 3, "eef_quat": 4, "gripper_qpos": 2}
    with h5py.File(tmp_path / "real.hdf5", "w") as file:
        demo = file.create_group("data/demo_0")
        demo.attrs["task"] = "close the lid"
        demo["actions"] = rng.uniform(-1, 1, (6, 7))
        for name, size in sizes.items():
            demo[f"obs/{name}"] = rng.normal(size=(6, size))
        for camera in ("left", "right", "wrist"):
            demo[f"obs/{camera}_image"] = moving_pictures(6, 32)
    settings = ConversionSettings(mapping=_mapping(tmp_path, yaml.safe_load(FIXED_ARM_EXAMPLE)))
    convert([tmp_path / "real.hdf5"], tmp_path / "real", settings)
    assert verify(tmp_path / "real", pictures_per_episode=None).passed
    with h5py.File(tmp_path / "real.hdf5") as file:
        actions, position = file["data/demo_0/actions"][()], file["data/demo_0/obs/eef_pos"][()]
    stored = column(tmp_path / "real", "action")
    assert np.array_equal(stored[:, contract.ACTION_SLICES["end_effector_position"]], actions[:, :3])
    assert np.array_equal(stored[:, contract.ACTION_SLICES["control_mode"]], -np.ones((6, 1)))
    state = column(tmp_path / "real", "observation.state")
    assert np.array_equal(state[:, contract.STATE_SLICES["end_effector_position_relative"]], position)
    assert np.array_equal(state[:, :7], np.tile([0, 0, 0, 0, 0, 0, 1], (6, 1)))
    simulated = write_fake_dataset(tmp_path / "simulated", episodes=1, length=4, image_size=32)
    together = MixtureDataset(MixtureConfig([MemberConfig(str(tmp_path / "real")), MemberConfig(str(simulated))]))
    assert together.meta.total_frames == 10


@pytest.mark.parametrize(
    "part",
    [
        {"constant": []},
        {"constant": ["a"]},
        {"constant": [0, True]},
        {"constant": [0], "key": "obs/x"},
        {"constant": 1},
    ],
)
def test_constants_of_a_mapping_that_mean_nothing_are_refused(tmp_path: Path, part: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="a constant is a list of numbers"):
        _mapping(tmp_path, {**LIBERO, "state": {"base": part}})
    with pytest.raises(UserError, match="constants only"):
        _mapping(tmp_path, {**LIBERO, "action": {"base": {"constant": [0.0]}}})


def _fixed_arm(path: Path) -> Path:
    rng = np.random.default_rng(0)
    with h5py.File(path, "w") as file:
        demo = file.create_group("data/demo_0")
        demo.attrs["task"] = "close the lid"
        demo["actions"], demo["base"] = rng.uniform(-1, 1, (6, 7)), rng.uniform(-1, 1, (6, 4))
        for name, size in {"eef_pos": 3, "eef_quat": 4, "gripper_qpos": 2}.items():
            demo[f"obs/{name}"] = rng.normal(size=(6, size))
        for camera in ("left", "right", "wrist"):
            demo[f"obs/{camera}_image"] = moving_pictures(6, 32)
    return path


def test_parts_of_the_benchmarks_robot_come_in_the_contracts_order(tmp_path: Path) -> None:
    path, content = _fixed_arm(tmp_path / "real.hdf5"), yaml.safe_load(FIXED_ARM_EXAMPLE)
    content["action"]["base_motion"] = "base"  # a dataset of another width than that of the first part of the file
    turned = content | {key: dict(reversed(content[key].items())) for key in ("state", "action")}
    for name, each in (("as it is", content), ("turned", turned)):
        root = convert([path], tmp_path / name, ConversionSettings(mapping=_mapping(tmp_path, each))).root
        assert verify(root).passed
    for key in ("action", "observation.state"):
        assert np.array_equal(column(tmp_path / "turned", key), column(tmp_path / "as it is", key))
        features = [LeRobotDataset("local/x", root=tmp_path / name).features[key] for name in ("as it is", "turned")]
        assert features[0]["names"] == features[1]["names"]


@pytest.mark.parametrize("where", ["state", "action"])
def test_the_benchmarks_robot_lacks_nothing(tmp_path: Path, where: str) -> None:
    path, content = _fixed_arm(tmp_path / "real.hdf5"), yaml.safe_load(FIXED_ARM_EXAMPLE)
    name = next(iter(content[where]))
    size = len(content[where][name]["constant"])
    content[where][name] = {"constant": [0] * (size + 1)}
    with pytest.raises(UserError, match=f"its {name} has {size + 1} components; PandaOmron has {name} of {size}"):
        make_plan([path], ConversionSettings(mapping=_mapping(tmp_path, content)))
    del content[where][name]
    with pytest.raises(UserError, match=f"{where} of the mapping: it has no part '{name}'"):
        make_plan([path], ConversionSettings(mapping=_mapping(tmp_path, content)))


def test_each_file_is_read_as_it_is_itself(tmp_path: Path) -> None:
    files = [write_libero(tmp_path / name) for name in ("a.hdf5", "b.hdf5")]
    with h5py.File(files[1], "a") as file:
        for name in ("demo_0", "demo_1"):  # wider, which a slice does not mind
            values = np.random.default_rng(7).normal(size=(5, 8))
            del file[f"data/{name}/obs/ee_states"]
            file[f"data/{name}/obs/ee_states"] = values
            file[f"data/{name}/actions"][...] += 1  # no copy of the other file's
    content = _with(LIBERO, state={"eef": {"key": "obs/ee_states", "slice": [0, 6]}})
    result = convert(files, tmp_path / "out", ConversionSettings(mapping=_mapping(tmp_path, content)), workers=1)
    assert (result.num_episodes, result.rejected) == (4, [])
    stored = column(tmp_path / "out", "observation.state")[10:15]
    assert np.array_equal(stored, np.random.default_rng(7).normal(size=(5, 8))[:, :6])
    assert verify(tmp_path / "out").passed
