"""Datasets rendered again from their kept states: other cameras and sizes, everything else bit for bit."""

from __future__ import annotations

import gzip
import json
import shutil
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from convert_support import SCENE, leftovers, tree_hashes, write_demos
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.rerender import work as rerender_work
from robocasa_lerobot.convert.rerender.camera_configs import camera_set, read_camera_configs, with_cameras
from robocasa_lerobot.convert.rerender.plan import RenderSettings, make_render_plan
from robocasa_lerobot.convert.rerender.work import render_dataset
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.errors import UserError

ABOVE = {"above": {"parent_body": "world", "pos": [1, 0, 3], "quat": [1, 0, 0, 0], "camera_attribs": {"fovy": 70}}}


@pytest.fixture(scope="module")
def converted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset with one small stored camera, its models and states kept; its source file is gone."""
    folder = tmp_path_factory.mktemp("converted")
    source = write_demos(folder / "demos.hdf5", (9, 1, 12), images=32)
    convert([source], folder / "data", ConversionSettings(cameras=contract.CAMERAS[:1]))
    source.unlink()
    return folder / "data"


def _settings(**fields: Any) -> RenderSettings:
    configs = json.dumps(fields.pop("configs", {}))
    return RenderSettings(cam_configs=configs, **fields)


@pytest.mark.render
def test_new_cameras_and_sizes_leave_everything_else_as_it_was(converted: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    cameras = (contract.CAMERAS[2], "above")
    result = render_dataset(converted, out, _settings(cameras=cameras, image_size=48, configs=ABOVE), workers=1)
    assert not isinstance(result, str)
    assert (result.num_episodes, result.num_frames, result.cameras) == (3, 22, cameras)
    assert leftovers(out) == ["out"]
    before, after = tree_hashes(converted), tree_hashes(out)
    same = [name for name in before if name.startswith(("data/", "extras/", "meta/tasks"))]
    assert len(same) >= 3 * 3 + 2
    assert {name: after[name] for name in same} == {name: before[name] for name in same}
    assert after[f"{META_FOLDER}/episodes.jsonl"] == before[f"{META_FOLDER}/episodes.jsonl"]

    dataset = LeRobotDataset("local/out", root=out, video_backend="pyav", return_uint8=True)
    assert set(dataset.meta.video_keys) == {contract.image_key(camera) for camera in cameras}
    assert dataset[21][contract.image_key("above")].shape == (3, 48, 48)
    for index in (0, 1, 2):
        entry = dataset.meta.episodes[index]
        key = f"videos/{contract.image_key('above')}"
        assert entry[f"{key}/to_timestamp"] - entry[f"{key}/from_timestamp"] == pytest.approx(entry["length"] / 20)
    stats = json.loads((out / "meta" / "stats.json").read_text())
    old = json.loads((converted / "meta" / "stats.json").read_text())
    assert set(stats) == set(dataset.meta.features)
    assert all(stats[key] == old[key] for key in (contract.ACTION_KEY, contract.STATE_KEY, "index"))
    names = json.loads((out / "meta" / "modality.json").read_text())
    assert list(names["video"]) == list(cameras)
    assert names["state"] == json.loads((converted / "meta" / "modality.json").read_text())["state"]

    report = verify(out, pictures_per_episode=None)
    assert report.passed, report.as_json()
    assert sum(len(camera.psnr_db) for camera in report.cameras) == 2 * 22


@pytest.mark.render
def test_verify_notices_what_was_changed(converted: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    render_dataset(converted, out, _settings(cameras=contract.CAMERAS[1:]), workers=1)
    left, right = (out / "videos" / contract.image_key(name) for name in contract.CAMERAS[1:])
    left.rename(tmp_path / "left")
    right.rename(left)
    (tmp_path / "left").rename(right)
    (out / "extras" / "episode_000000" / "ep_meta.json").write_text("{}")
    failed = {check.name for check in verify(out).checks if not check.passed}
    assert failed == {"pictures", "extras"}


@pytest.mark.render
def test_moved_cameras_stay_moved_when_rendered_once_more(converted: Path, tmp_path: Path) -> None:
    name = contract.CAMERAS[0]
    moved = {name: {"pos": [-0.3, 0.1, 1.2], "camera_attribs": {"fovy": 90}}}
    render_dataset(converted, tmp_path / "one", _settings(configs=moved, image_size=64), workers=1)
    render_dataset(tmp_path / "one", tmp_path / "two", _settings(), workers=1)
    render_dataset(converted, tmp_path / "plain", _settings(image_size=64), workers=1)
    pictures = {}
    for folder in ("one", "two", "plain"):
        dataset = LeRobotDataset("local/x", root=tmp_path / folder, video_backend="pyav", return_uint8=True)
        pictures[folder] = dataset[5][contract.image_key(name)].numpy().astype(int)
    assert np.array_equal(pictures["one"], pictures["two"])
    assert np.abs(pictures["one"] - pictures["plain"]).mean() > 5
    wider = _settings(configs={name: {"camera_attribs": {"fovy": 110}}})  # which says nothing of where it is
    merged = json.loads(make_render_plan(tmp_path / "one", wider).settings.cam_configs)
    assert merged == {name: {"pos": [-0.3, 0.1, 1.2], "camera_attribs": {"fovy": [110.0]}}}


@pytest.mark.costly
@pytest.mark.render
def test_rendering_goes_on_after_an_interruption_and_does_not_depend_on_the_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = write_demos(tmp_path / "demos.hdf5", (9, 8, 7), images=16)
    convert([source], tmp_path / "data", ConversionSettings(cameras=contract.CAMERAS[:1]))
    monkeypatch.setattr("robocasa_lerobot.convert.rerender.plan.SHARD_FRAMES", 8)
    settings = _settings(image_size=32)
    assert len(make_render_plan(tmp_path / "data", settings).pieces) == 3
    done: list[int] = []
    render = rerender_work._render_episode

    def failing(plan: Any, episode: Any, *rest: Any) -> int:
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(episode.index)
        return render(plan, episode, *rest)

    monkeypatch.setattr(rerender_work, "_render_episode", failing)
    with pytest.raises(KeyboardInterrupt):
        render_dataset(tmp_path / "data", tmp_path / "out", settings, workers=1)
    assert not (tmp_path / "out").exists()
    done.clear()
    render_dataset(tmp_path / "data", tmp_path / "out", settings, workers=1)
    assert done == [2]
    monkeypatch.setattr(rerender_work, "_render_episode", render)
    render_dataset(tmp_path / "data", tmp_path / "two", settings, workers=2)
    assert leftovers(tmp_path / "out") == ["out"]
    record = f"{META_FOLDER}/conversion.json"
    one, two = tree_hashes(tmp_path / "out"), tree_hashes(tmp_path / "two")
    assert {k: v for k, v in one.items() if k != record} == {k: v for k, v in two.items() if k != record}


def test_what_cannot_be_rendered_is_said_before_anything_is_written(converted: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"

    def refused(match: str, source: Path = converted, **fields: Any) -> None:
        with pytest.raises(UserError, match=match):
            render_dataset(source, out, _settings(**fields), workers=1)
        assert leftovers(out) == []

    refused("robot0_agentview_left", cameras=("robot0_agentview_lft",))
    refused("--cam-configs", cameras=("overhead",))
    refused("no body 'wrld' .*Did you mean 'world'", configs={"above": ABOVE["above"] | {"parent_body": "wrld"}})
    refused("lacks parent_body", configs={"above": {"pos": [0, 0, 3], "quat": [1, 0, 0, 0]}})
    refused("is no LeRobot dataset", source=tmp_path)
    copy = Path(shutil.copytree(converted, tmp_path / "copy"))
    (copy / "extras" / "episode_000001" / "states.npz").unlink()
    refused("episode 1 .* cannot be rendered", source=copy)
    shutil.rmtree(copy / "extras")
    refused("convert the recording again", source=copy)
    with pytest.raises(UserError, match="the source itself"):
        render_dataset(converted, converted, _settings(), workers=1, overwrite=True)
    with pytest.raises(UserError, match="is inside the dataset"):
        render_dataset(converted, converted / "again", _settings(), workers=1)
    with pytest.raises(UserError, match="even number"):
        RenderSettings(image_size=33)
    with pytest.raises(UserError, match="image size 100000"):
        RenderSettings(image_size=100_000)


@pytest.mark.render
def test_an_episode_whose_scene_lacks_a_camera_is_named(converted: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(converted, tmp_path / "copy"))
    file, camera = copy / "extras" / "episode_000002" / "model.xml.gz", contract.CAMERAS[1]
    xml = gzip.decompress(file.read_bytes()).replace(camera.encode(), b"elsewhere")
    file.write_bytes(gzip.compress(xml))
    with pytest.raises(UserError, match=f"episode 2 of .* cannot be rendered: unknown camera '{camera}'"):
        render_dataset(copy, tmp_path / "out", _settings(cameras=(camera,), image_size=32), workers=1)
    assert not (tmp_path / "out").exists()


@pytest.mark.render
def test_command_with_a_file_of_cameras(converted: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"lang": "x", "cam_configs": ABOVE}))
    command = ["render", str(converted), "--out", str(tmp_path / "out"), "--cam-configs", str(file), "--workers", "1"]
    assert cli.main(command) == 0
    assert "22 frames, cameras robot0_agentview_left, above" in capsys.readouterr().out
    assert cli.main(command) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert cli.main(["render", str(converted), "--out", str(tmp_path / "x"), "--camera-set", "cotrainin"]) == 2
    assert "Did you mean 'cotraining'" in capsys.readouterr().err


BAD_CAMERAS = {
    "no camera": ("a: 3", "expected parent_body"),
    "empty": ("", "expected cameras by name"),
    "unknown key": ("a: {position: [0, 0, 0]}", "Did you mean"),
    "two numbers": ("a: {pos: [0, 0]}", "3 finite number"),
    "not finite": ("a: {pos: [0, 0, .nan]}", "3 finite number"),
    "no rotation": ("a: {quat: [0, 0, 0, 0]}", "rotation"),
    "unknown attribute": ("a: {camera_attribs: {fov: 60}}", "fovy"),
    "wide angle": ("a: {camera_attribs: {fovy: 190}}", "below 180"),
    "half a lens": ("a: {camera_attribs: {focal: [1, 1]}}", "sensorsize"),
}


@pytest.mark.parametrize("case", BAD_CAMERAS)
def test_wrong_descriptions_of_cameras(case: str, tmp_path: Path) -> None:
    text, message = BAD_CAMERAS[case]
    (tmp_path / "cameras.yaml").write_text(text)
    with pytest.raises(UserError, match=message):
        read_camera_configs(tmp_path / "cameras.yaml")


def _model(xml: str) -> mujoco.MjModel:
    text = xml.replace('file="textures/checks.png"', 'builtin="flat" width="8" height="8"')
    mesh = text[text.index('<mesh name="tile"') :].split("/>")[0] + "/>"
    return mujoco.MjModel.from_xml_string(text.replace(mesh, '<mesh name="tile" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'))


def test_cameras_are_moved_and_added_in_the_scene() -> None:
    name = contract.CAMERAS[1]
    configs: dict[str, Any] = {
        name: {"pos": [0.1, 0.2, 0.3], "quat": [0.6, 0.8, 0, 0], "parent_body": "robot0_right_hand"},
        "lens": {
            **{"parent_body": "world", "pos": [0, 0, 2], "quat": [1, 0, 0, 0]},
            "camera_attribs": {"focalpixel": [606, 606], "resolution": [640, 480], "sensorsize": [5.5, 3]},
        },
    }
    before, after = _model(SCENE), _model(with_cameras(SCENE, configs))
    moved = after.camera(name)
    assert after.body(int(moved.bodyid[0])).name == "robot0_right_hand"
    assert np.allclose(moved.pos, [0.1, 0.2, 0.3])
    assert np.allclose(moved.quat, [0.6, 0.8, 0, 0])
    assert moved.fovy == before.camera(name).fovy
    other = contract.CAMERAS[0]
    assert np.array_equal(after.camera(other).quat, before.camera(other).quat)
    assert tuple(after.cam_resolution[after.camera("lens").id]) == (640, 480)
    assert after.ncam == before.ncam + 1
    assert with_cameras(SCENE, {}) == SCENE
    with pytest.raises(RejectedEpisodeError, match="entities"):
        with_cameras('<!DOCTYPE x [<!ENTITY a "b">]><mujoco/>', configs)


def test_cotraining_set_is_the_environments_own() -> None:
    from robocasa_lerobot.envs.robots.cameras import apply_camera_configs
    from robocasa_lerobot.envs.robots.panda_omron import names
    from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

    bodies = ""
    for body, cameras in ((names.SUPPORT, contract.CAMERAS[:2]), (names.HAND, contract.CAMERAS[2:])):
        inside = "".join(f'<camera name="{name}"/>' for name in cameras)
        bodies += f'<body name="{body}"><geom size="1"/>{inside}</body>'
    xml = f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"
    ours = mujoco.MjModel.from_xml_string(with_cameras(xml, camera_set("cotraining")))
    model = mujoco.MjModel.from_xml_string(xml)
    apply_camera_configs(model, camera_set("cotraining"))
    for camera in PANDA_OMRON.cameras("cotraining"):
        if camera.name not in contract.CAMERAS:
            continue
        index = model.camera(camera.name).id
        assert np.allclose(ours.cam_pos[index], camera.pos)
        assert np.allclose(ours.cam_quat[index], camera.quat, atol=1e-6)
        for field in ("cam_pos", "cam_quat", "cam_fovy", "cam_sensorsize", "cam_resolution", "cam_intrinsic"):
            assert np.allclose(getattr(ours, field)[index], getattr(model, field)[index], atol=1e-6), field
