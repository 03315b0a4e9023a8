"""`inspect`: what files and datasets hold is said, and the draft of a mapping converts and verifies as it is."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from convert_layouts import (
    OSC_POSE,
    write_aloha,
    write_libero,
    write_mimicgen,
    write_raw_collection,
    write_robocasa_v01,
    write_robosuite,
)
from convert_support import INSTRUCTION, moving_pictures, write_demos

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert.inspect.draft import draft_mapping
from robocasa_lerobot.convert.inspect.hdf5 import describe, inspect_hdf5
from robocasa_lerobot.convert.mapping.custom import read_mapping
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.errors import UserError


def _other_groups(path: Path) -> Path:
    """Episodes under another name, with strings as language, a grey picture and a table of no known meaning."""
    with h5py.File(path, "w") as file:
        for index in (2, 10):
            episode = file.create_group(f"trajectories/run_{index}")
            episode["commands/action"] = np.linspace(0, 1, 30).reshape(5, 6)
            episode["robot/wheels"] = np.ones((5, 2))
            episode["language"] = "drive äround"
            episode["rgb/front"] = moving_pictures(5, 32)
            episode["grey_image"] = np.zeros((5, 32, 32, 1), np.uint8)
    return path


def _two_arms(path: Path) -> Path:
    return write_robosuite(path, ("robot0_", "robot1_"), 14, {"robots": ["A", "B"], "controller_configs": OSC_POSE})


def _pictures(path: Path) -> Path:
    return write_demos(path, (4, 3), images=32)


# Robot that is recognised, or None; and a line of the report.
LAYOUTS: dict[str, tuple[Callable[[Path], Path], str | None, str]] = {
    "ours": (_pictures, contract.ROBOT_TYPE, "obs/robot0_base_pos  (T, 3) float64"),
    "robocasa v0.1": (write_robocasa_v01, contract.ROBOT_TYPE, "filter keys: 2_demos (2), gone (1), train (3)"),
    "mimicgen": (write_mimicgen, contract.ROBOT_TYPE, "datagen_info/eef_pose  (T, 4, 4) float64"),
    "two arms": (_two_arms, "A+B", "robot1_gripper_close 1"),
    "libero": (write_libero, None, "stored pictures: obs/agentview_rgb (32x32)"),
    "one episode": (write_aloha, None, "observations/qpos  (T, 14) float32"),
    "other groups": (_other_groups, None, "episodes: 2 (trajectories/run_*: run_2 to run_10)"),
}  # fmt: skip


@pytest.mark.costly
@pytest.mark.parametrize("case", LAYOUTS)
def test_layouts_are_understood_and_their_drafts_convert(case: str, tmp_path: Path) -> None:
    from robocasa_lerobot.convert.pipeline import convert
    from robocasa_lerobot.convert.verify import verify

    write, robot, line = LAYOUTS[case]
    path = write(tmp_path / "pick_it_up.hdf5")
    report = inspect_hdf5(path)
    text = describe(report)
    assert line in text
    assert (report.mapping.robot_type if report.mapping is not None else None) == robot
    assert not report.problems
    draft = tmp_path / "draft.yaml"
    draft.write_text(draft_mapping(report), encoding="utf-8")
    settings = ConversionSettings(
        mapping=read_mapping(draft), demos=report.episodes[0] if len(report.episodes) > 1 else None
    )
    result = convert([path], tmp_path / "out", settings)
    assert (result.num_episodes, result.num_frames) == (1, report.lengths[0])
    verified = verify(tmp_path / "out")
    assert verified.passed, verified.as_json()
    told = json.loads((tmp_path / "out" / "meta" / "robocasa" / "episodes.jsonl").read_text().splitlines()[0])
    expected = {"two arms": "two arm lift", "one episode": "pick it up", "other groups": "drive äround"}
    assert told["instruction"] == expected.get(case, INSTRUCTION)


@pytest.mark.render
def test_a_draft_for_a_file_without_pictures_renders(tmp_path: Path) -> None:
    from robocasa_lerobot.convert.pipeline import convert
    from robocasa_lerobot.convert.verify import verify

    path = write_raw_collection(tmp_path / "raw.hdf5")
    draft = tmp_path / "draft.yaml"
    report = inspect_hdf5(path)
    assert set(report.scene_cameras) == set(contract.CAMERAS)
    draft.write_text(draft_mapping(report), encoding="utf-8")
    convert([path], tmp_path / "out", ConversionSettings(mapping=read_mapping(draft), image_size=32))
    assert verify(tmp_path / "out").passed


def test_real_human_demonstrations(shared: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["inspect", str(shared / "real" / "robosuite_lift" / "demo.hdf5")]) == 0
    text = capsys.readouterr().out
    assert "steps: 1,384 (episodes of 392 to 510, median 482), 20 Hz" in text
    assert "robot: Panda" in text
    assert "action: end_effector_position 3, end_effector_rotation 3, gripper_close 1" in text


def test_real_dataset(shared: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["inspect", str(shared / "real" / "groot_picknplace")]) == 0
    text = capsys.readouterr().out
    assert "LeRobot dataset v2.0" in text
    assert "observation.images.egoview  (800, 1280, 3) video  (declared, but has no files)" in text
    assert "episodes: 5 of 328 to 470, 2096 frames" in text


def test_our_datasets_name_their_sources(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = _pictures(tmp_path / "a.hdf5")
    with h5py.File(source, "a") as file:
        file["data/demo_1/actions"][0, 0] = np.nan
    assert cli.main(["convert", str(source), "--out", str(tmp_path / "out")]) == 0
    capsys.readouterr()
    assert cli.main(["inspect", str(tmp_path / "out"), "--report", "json"]) == 0
    report = json.loads(capsys.readouterr().out)[0]
    assert (report["codebase_version"], report["episodes"], report["rejected"]) == ("v3.0", 1, 1)
    assert report["lengths"] == [4]
    assert report["tasks"] == [INSTRUCTION]
    assert report["converted_from"] == [str(source)]
    assert all(report["videos"].values())


def test_problems_are_listed_beside_what_is_good(tmp_path: Path) -> None:
    path = _pictures(tmp_path / "a.hdf5")
    with h5py.File(path, "a") as file:
        del file["data/demo_0/actions"], file["data/demo_1/obs/robot0_base_pos"]
        file["mask/broken"] = np.zeros(3)
    report = inspect_hdf5(path)
    assert report.lengths == [3]
    assert "actions" in report.problems["demo_0"]
    assert "mask/broken" in report.problems["mask"]
    assert "obs/robot0_base_pos  (T, 3) float64  (in 1 of 2 episodes)" in describe(report).replace("(4, 3)", "(T, 3)")


def test_files_without_demonstrations(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.hdf5"
    with h5py.File(path, "w") as file:
        file["weights/layer"] = np.zeros((3, 3))
    assert cli.main(["inspect", str(path)]) == 0
    assert "no episodes found" in capsys.readouterr().out
    with pytest.raises(UserError, match="nothing to draft"):
        draft_mapping(inspect_hdf5(path))
    path.write_text("no HDF5")
    assert cli.main(["inspect", str(path)]) == 2
    assert cli.main(["inspect", str(tmp_path / "nothing.hdf5")]) == 2


def test_drafts_replace_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, draft = write_libero(tmp_path / "a file.hdf5"), tmp_path / "draft.yaml"
    command = ["inspect", str(path), "--draft-mapping", str(draft)]
    assert cli.main(command) == 0
    assert f"robocasa-lerobot convert '{path}' --mapping ..." in capsys.readouterr().out  # can be typed as it is
    written = draft.read_bytes()
    assert cli.main(command) == 2
    assert "exists already" in capsys.readouterr().err
    assert draft.read_bytes() == written
    assert cli.main(["inspect", str(path), str(path), "--draft-mapping", str(tmp_path / "other.yaml")]) == 2
