"""Preparing demonstrations: what is written beside them, what stays as it was, and what is no source."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import h5py
import mujoco
import numpy as np
import pytest
from full_disk import full_after

from robocasa_lerobot import cli, contract
from robocasa_lerobot.demos.generate.sources.prepare import (
    DROPPED,
    FILE,
    known_outcomes,
    prepare_files,
    prepare_one,
    work_identity,
)
from robocasa_lerobot.demos.generate.sources.prepared import GROUP, read_prepared
from robocasa_lerobot.demos.generate.sources.segments import PART, cut, runs
from robocasa_lerobot.demos.generate.sources.transform import (
    SMALL_TURN_RAD,
    carried_over,
    command_to,
    interpolated,
    inverse,
    make_pose,
    mirrored,
    target_of,
    yaw_pose,
)
from robocasa_lerobot.demos.motion import Array, action, grip_position, hand_rotation, rotation_about
from robocasa_lerobot.demos.recording import RecordingSettings, record_tasks
from robocasa_lerobot.envs.kitchen_env import KitchenEnv


def _pose(rng: np.random.Generator) -> Array:
    axis = rng.normal(size=3)
    turn = rotation_about(axis / np.linalg.norm(axis), float(rng.uniform(-3.0, 3.0)))
    return make_pose(rng.normal(size=3), turn)


def _reference_bridge(start: Array, end: Array, steps: int) -> Array:
    """The published bridge in other words: a grid of steps + 1, quaternions, the first pose left out."""
    quats = [np.empty(4), np.empty(4), np.empty(4)]
    for quat, pose in zip(quats, (start, end), strict=False):
        mujoco.mju_mat2Quat(quat, pose[:3, :3].reshape(9))
    inverted = quats[0] * [1.0, -1.0, -1.0, -1.0]
    mujoco.mju_mulQuat(quats[2], quats[1], inverted)
    delta = quats[2] if quats[2][0] >= 0 else -quats[2]
    angle = 2.0 * np.arccos(np.clip(delta[0], -1.0, 1.0))
    out = []
    for number in range(1, steps + 2):
        share = number / (steps + 1)
        turn, whole = np.empty(9), np.empty(4)
        if angle < SMALL_TURN_RAD:
            turn = end[:3, :3].reshape(9)
        else:
            part = np.array([np.cos(share * angle / 2), *(delta[1:] / np.sin(angle / 2) * np.sin(share * angle / 2))])
            mujoco.mju_mulQuat(whole, part, quats[0])
            mujoco.mju_quat2Mat(turn, whole)
        out.append(make_pose((1 - share) * start[:3, 3] + share * end[:3, 3], turn.reshape(3, 3)))
    return np.array(out)


def test_a_segment_is_carried_over_and_bridged_as_published() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        then, now, segment = _pose(rng), _pose(rng), np.array([_pose(rng) for _ in range(7)])
        moved = carried_over(now, then, segment)
        for before, after in zip(segment, moved, strict=True):
            np.testing.assert_allclose(
                np.linalg.solve(now, after), np.linalg.solve(then, before), atol=1e-9
            )  # the same relative to each frame
        np.testing.assert_allclose(interpolated(then, now, 5), _reference_bridge(then, now, 5), atol=1e-9)
    small = make_pose(then[:3, 3] + 0.1, rotation_about(np.array([0.0, 0.0, 1.0]), 0.04) @ then[:3, :3])
    np.testing.assert_allclose(interpolated(then, small, 3), _reference_bridge(then, small, 3), atol=1e-9)
    np.testing.assert_array_equal(interpolated(then, small, 3)[0, :3, :3], small[:3, :3])  # a small turn at once


def test_a_mirror_image_is_a_hand_and_its_own_inverse() -> None:
    pose = _pose(np.random.default_rng(1))
    other = mirrored(pose)
    assert np.linalg.det(other[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_allclose(mirrored(other), pose, atol=1e-12)
    assert other[0, 3] == -pose[0, 3]
    np.testing.assert_allclose(inverse(pose) @ pose, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("mode", [-1.0, 1.0])
def test_a_target_becomes_a_command_and_the_controllers_goal(mode: float) -> None:
    """Exact with a base that is turned and drives, in both control modes."""
    env = KitchenEnv("CloseDrawer", split="pretrain", cameras=(), terminate_on_success=False)
    env.reset(seed=100_000)
    rng = np.random.default_rng(3)
    driving = np.array([0.0, 0.0, 0.9, 0.0])
    for _ in range(12):
        env.step(action(gripper=-1.0, base=driving, mode=1.0).astype(np.float32))
    site = env.data.site(env.scene.robot.names.grip_site).xmat.reshape(3, 3)
    to_hand = site.T @ hand_rotation(env.data)
    for _ in range(6):
        frame = make_pose(*env.controller.arm_frame())
        reached = inverse(frame) @ make_pose(grip_position(env.data), hand_rotation(env.data))
        position, turn = env.controller.goal_in_base()
        origin = reached if mode < 0 else make_pose(position, turn @ to_hand)
        wanted = frame @ target_of(rng.uniform(-0.9, 0.9, 3), rng.uniform(-0.5, 0.5, 3), origin)
        move, twist = command_to(inverse(frame) @ wanted, origin)
        assert max(np.abs(move).max(), np.abs(twist).max()) < 1.0
        command = action(position=move, rotation=twist, gripper=-1.0, base=driving, mode=mode)
        env.controller.set_action(contract.stored_to_hdf5(command))
        position, turn = env.controller.goal_in_base()
        np.testing.assert_allclose(frame @ make_pose(position, turn @ to_hand), wanted, atol=1e-6)
        env.step(command.astype(np.float32))
    env.close()


def test_runs() -> None:
    held = np.array([0, 1, 1, 0, 0, 1, 0, 0, 0, 0, 1], dtype=bool)
    assert runs(held, 0) == [(1, 3), (5, 6), (10, 11)]
    assert runs(held, 2) == [(1, 6), (10, 11)]
    assert runs(np.zeros(3, dtype=bool), 2) == []


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("demos")
    record_tasks([RecordingSettings("CloseDrawer", 2, split="pretrain", seed=100_000)], out, show_progress=False)
    return out / "CloseDrawer.hdf5"


def _arrays(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = {}
    with h5py.File(path) as file:

        def visit(name: str, item: h5py.HLObject) -> None:
            if isinstance(item, h5py.Dataset) and GROUP not in name:
                found[name] = item[()].tobytes()

        file.visititems(visit)
    return found


@pytest.mark.slow
def test_a_file_is_prepared_and_what_was_recorded_stays(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = Path(shutil.copy(recorded, tmp_path))
    with h5py.File(path, "r+") as file:
        file["data/demo_1/actions"][:] = 0.0
    before = _arrays(path)
    # One of them was prepared before a kill.
    parts = tmp_path / ".CloseDrawer.prepare"
    parts.mkdir()
    (parts / FILE).write_text(json.dumps(work_identity(path)))
    prepare_one(path, "demo_0", parts)
    stamp = (parts / "demo_0.hdf5").stat().st_mtime_ns
    assert prepare_one(path, "demo_0", parts).dropped == ""
    assert (parts / "demo_0.hdf5").stat().st_mtime_ns == stamp
    assert cli.main(["prepare", str(path), "--workers", "1"]) == 0
    assert "1 of 2 demonstrations are sources" in capsys.readouterr().out
    assert _arrays(path) == before
    assert not parts.exists()
    with h5py.File(path) as file:
        assert list(json.loads(file["data"].attrs[DROPPED])["reasons"]) == ["demo_1"]
        assert GROUP not in file["data/demo_1"]
        group = file["data/demo_0"][GROUP]
        steps = len(file["data/demo_0/actions"])
        for name in ("eef_pose", "target_pose"):  # what MimicGen's own reader asks for
            assert group[name].shape == (steps, 4, 4)
        assert group["gripper_action"].shape == (steps, 1)
        assert {"env_interface_name", "env_interface_type"} <= set(group.attrs)
        assert all(poses.shape == (steps, 4, 4) for poses in group["object_poses"].values())
        assert group["subtask_term_signals"] is not None
        found = read_prepared(group)
        actions = contract.hdf5_to_stored(file["data/demo_0/actions"][()])
    np.testing.assert_array_equal(found.gripper, actions[:, -1])
    (segment,) = cut(found)
    assert (segment.kind, segment.ref) == (PART, "drawer.box")
    assert 0 < segment.lead < segment.contact < segment.release <= segment.end == steps
    path_of_drawer = found.joints["drawer.box"]
    assert abs(path_of_drawer[segment.contact] - path_of_drawer[0]) < 0.005
    assert abs(path_of_drawer[segment.release - 1]) < 0.02  # it is shut
    # Targets lie where full commands reach, and the hand goes after them.
    ahead = np.linalg.norm(found.target[:, :3, 3] - found.eef[:, :3, 3], axis=1)
    assert ahead.max() < 0.05 * np.sqrt(3) + 1e-3
    assert list(prepare_files([path])) == list(prepare_files([path]))  # done already
    for words, again in (([], False), (["--fresh"], True)):  # a file that is prepared takes the other one's place
        written = path.stat().st_ino
        assert cli.main(["prepare", str(path), "--workers", "1", *words]) == 0
        assert (path.stat().st_ino != written) == again
    assert _arrays(path) == before
    (tmp_path / ".CloseDrawer.prepare").mkdir()  # a run was killed when it had replaced the file
    assert len(list(prepare_files([path]))) == 2
    assert [one.name for one in tmp_path.iterdir()] == ["CloseDrawer.hdf5"]
    with h5py.File(path, "r+") as file:  # what other versions have dropped these may replay
        words = json.loads(file["data"].attrs[DROPPED])
        words["versions"]["mujoco_version"] = "0"
        file["data"].attrs[DROPPED] = json.dumps(words)
    assert set(known_outcomes(path)) == {"demo_0"}


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.1, 1.01])  # of a demonstration's own file, and of the whole one
def test_a_full_disk_leaves_the_file_as_it_was_recorded(
    recorded: Path, tmp_path: Path, share: float, capsys: pytest.CaptureFixture[str]
) -> None:
    path = Path(shutil.copy(recorded, tmp_path))
    before = path.read_bytes()
    with full_after(int(share * len(before))):
        assert cli.main(["prepare", str(path), "--workers", "1"]) == 2
    assert "Free disk space" in capsys.readouterr().err
    assert path.read_bytes() == before
    assert cli.main(["prepare", str(path), "--workers", "1"]) == 0


@pytest.mark.slow
def test_what_was_prepared_of_another_recording_is_not_taken(recorded: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(recorded, tmp_path))
    parts = tmp_path / ".CloseDrawer.prepare"
    parts.mkdir()
    (parts / FILE).write_text(json.dumps(work_identity(path)))
    (parts / "demo_0.json").write_text('"of the recording that had this name"')
    path.touch()
    assert [one.dropped for one in prepare_files([path])] == ["", ""]


@pytest.mark.slow
def test_files_are_published_one_by_one_by_the_same_processes(recorded: Path, tmp_path: Path) -> None:
    for name in ("one", "other"):
        shutil.copy(recorded, tmp_path / f"{name}.hdf5")
    found = []
    for outcome in prepare_files([tmp_path], workers=2):
        found.append(outcome)
        ended = Counter(one.path for one in found[:-1])
        for path in (path for path, number in ended.items() if number == 2 and path != outcome.path):
            with h5py.File(path) as file:
                assert all(GROUP in demo for demo in file["data"].values())
    assert len(found) == 4
    assert not any(one.dropped for one in found)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.hdf5", "other.hdf5"]


def test_floor_poses() -> None:
    pose = yaw_pose(1.0, 2.0, 0.5)
    np.testing.assert_allclose(pose[:3, 3], [1.0, 2.0, 0.0])
    assert np.arctan2(pose[1, 0], pose[0, 0]) == pytest.approx(0.5)
