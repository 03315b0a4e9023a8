"""LeRobotDataset v3.0 back to HDF5, and from there to the same dataset again."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import v2_support as v2
from convert_layouts import write_robocasa_v01
from convert_support import INSTRUCTION, write_demos
from full_disk import full_after

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert.export import ExportSettings, export
from robocasa_lerobot.convert.inspect.hdf5 import describe, inspect_hdf5
from robocasa_lerobot.convert.lerobot_v3 import ExportedDataset
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.convert.writing.statistics import column
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

LENGTHS = (14, 1, 9)
SETTINGS = ConversionSettings()


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """A file of demonstrations with pictures, the dataset made from it, and the file exported from that."""
    folder = tmp_path_factory.mktemp("ours")
    source = write_demos(folder / "OpenDrawer.hdf5", LENGTHS, images=32)
    root = convert([source], folder / "data", SETTINGS, workers=1).root
    return source, root, export(root, folder / "again.hdf5").path


def items(path: Path) -> dict[str, h5py.Dataset]:
    """All HDF5 datasets of a file by their names."""
    found: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = item[()]

    with h5py.File(path) as file:
        file.visititems(visit)
    return found


@pytest.mark.parametrize("share", [0.05, 0.5, 0.99])
def test_a_full_disk_is_explained_and_leaves_nothing(
    ours: tuple[Path, Path, Path], tmp_path: Path, share: float
) -> None:
    size = ours[2].stat().st_size
    with full_after(int(share * size)), pytest.raises(UserError, match="free disk space and repeat"):
        export(ours[1], tmp_path / "again.hdf5")
    assert not list(tmp_path.iterdir())


def test_vectors_states_and_scenes_are_those_of_the_source_bit_for_bit(ours: tuple[Path, Path, Path]) -> None:
    true, found = items(ours[0]), items(ours[2])
    pictures = {name for name in true if name.endswith("_image")}
    assert len(pictures) == 9
    for name in true.keys() - pictures:
        assert found[name].dtype == true[name].dtype
        assert found[name].tobytes() == true[name].tobytes(), name
    assert found.keys() - true.keys() == {f"data/demo_{i}/dones" for i in range(3)}
    with h5py.File(ours[0]) as source, h5py.File(ours[2]) as again:
        for index in range(3):
            before, after = (dict(file[f"data/demo_{index}"].attrs) for file in (source, again))
            assert json.loads(after.pop("ep_meta")) == json.loads(before.pop("ep_meta"))
            assert after == before
        assert again["data"].attrs["total"] == sum(LENGTHS)
        assert json.loads(again["data"].attrs["env_args"])["env_name"] == "OpenDrawer"


def test_pictures_are_the_decoded_ones(ours: tuple[Path, Path, Path]) -> None:
    true, found = items(ours[0]), items(ours[2])
    for name in (name for name in true if name.endswith("_image")):
        assert found[name].shape == true[name].shape
        error = np.square(found[name].astype(float) - true[name]).mean(axis=(1, 2, 3))
        assert error.max() < 200
        for step in range(1, len(error)):  # and not those of the step before
            assert np.square(found[name][step].astype(float) - true[name][step - 1]).mean() > 2 * error[step]


def test_converting_the_export_gives_the_same_vectors_and_verifies(
    ours: tuple[Path, Path, Path], tmp_path: Path
) -> None:
    again = convert([ours[2]], tmp_path / "again", SETTINGS, workers=1).root
    for key in ("action", "observation.state"):
        assert column(again, key).tobytes() == column(ours[1], key).tobytes()
    assert [line["instruction"] for line in read_jsonl(again / META_FOLDER / "episodes.jsonl")] == [INSTRUCTION] * 3
    assert (again / "extras/episode_000002/states.npz").is_file()
    report = verify(again)
    assert report.passed, report.as_json()


@pytest.mark.render
def test_export_without_images_renders_again(ours: tuple[Path, Path, Path], tmp_path: Path) -> None:
    path = export(ours[1], tmp_path / "states.hdf5", ExportSettings(images=False, compression="none")).path
    assert not [name for name in items(path) if name.endswith("_image")]
    # The texture is in the exported file; the mesh comes from an installed package.
    again = convert([path], tmp_path / "again", ConversionSettings(image_size=32), workers=1).root
    for key in ("action", "observation.state"):
        assert column(again, key).tobytes() == column(ours[1], key).tobytes()
    assert verify(again, pictures_per_episode=2).passed


def test_absolute_actions_come_back_under_their_own_key(tmp_path: Path) -> None:
    source, settings = write_robocasa_v01(tmp_path / "in.hdf5", size=32), ConversionSettings(action_key="actions_abs")
    root = convert([source], tmp_path / "data", settings, workers=1).root
    path = export(root, tmp_path / "out.hdf5").path
    true, found = items(source), items(path)
    assert found["data/demo_1/actions_abs"].tobytes() == true["data/demo_1/actions_abs"].tobytes()
    assert "data/demo_1/actions" not in found  # which are steps, and not poses to reach
    report = inspect_hdf5(path)
    assert (report.lengths, report.problems) == ([len(found[f"data/demo_{i}/actions_abs"]) for i in range(4)], {})
    assert "convert with --action-key actions_abs" in describe(report)
    with pytest.raises(UserError, match="--action-key actions_abs takes these"):
        convert([path], tmp_path / "again", SETTINGS, workers=1)
    again = convert([path], tmp_path / "again", settings, workers=1).root
    assert column(again, "action").tobytes() == column(root, "action").tobytes()


def test_vectors_of_a_panda_omron_need_no_names(ours: tuple[Path, Path, Path], tmp_path: Path) -> None:
    copy = Path(shutil.copytree(ours[1], tmp_path / "copy"))

    def forget(info: dict[str, Any]) -> None:
        for key in (contract.ACTION_KEY, contract.STATE_KEY):
            info["features"][key]["names"] = None

    v2.edit_json(copy / "meta" / "info.json", forget)
    true, found = items(ours[2]), items(export(copy, tmp_path / "out.hdf5", ExportSettings(images=False)).path)
    assert found["data/demo_0/actions"].tobytes() == true["data/demo_0/actions"].tobytes()
    assert {name for name in true if not name.endswith("_image")} == found.keys()


def test_robocasas_own_data_becomes_hdf5_and_comes_back(tmp_path: Path) -> None:
    source = v2.write_dataset(tmp_path / "in", (8, 5))
    root = convert([source], tmp_path / "data", SETTINGS, workers=1).root
    assert "# Demonstrations of kitchen tasks" in (root / "README.md").read_text(encoding="utf-8")
    result = export(root, tmp_path / "out.hdf5")
    assert (result.num_episodes, result.num_frames, result.notes) == (2, 13, ())
    found = items(result.path)
    actions = np.stack(v2.read_columns(source, 1)["action"].to_pylist())
    assert found["data/demo_1/actions"].tobytes() == contract.stored_to_hdf5(actions).tobytes()
    assert found["data/demo_1/rewards"].tolist() == [0, 0, 0, 0, 1]
    assert found["data/demo_1/dones"].tolist() == [0, 0, 0, 0, 1]
    again = convert([result.path], tmp_path / "again", SETTINGS, workers=1).root
    for key in ("action", "observation.state"):
        assert column(again, key).tobytes() == column(root, key).tobytes()
    lines = [read_jsonl(folder / META_FOLDER / "episodes.jsonl") for folder in (root, again)]
    for key in ("instruction", "task_name", "layout_id", "style_id"):
        assert [line[key] for line in lines[0]] == [line[key] for line in lines[1]]


def test_isaac_groot_data_has_its_whole_state_and_notes_what_is_lacking(tmp_path: Path) -> None:
    source = v2.write_dataset(tmp_path / "in", (6,), cameras=contract.CAMERAS[:1], extras=False)
    v2.edit_json(source / "meta" / "info.json", lambda info: info.update(robot_type="GR1"))
    (source / "meta" / "modality.json").unlink()
    root = convert([source], tmp_path / "data", SETTINGS, workers=1).root
    assert "itchen" not in (root / "README.md").read_text(encoding="utf-8")  # nobody says that it was recorded in one
    result = export(root, tmp_path / "out.hdf5")
    found = items(result.path)
    assert found["data/demo_0/obs/state"].tobytes() == column(root, "observation.state").tobytes()
    assert found["data/demo_0/actions"].tobytes() == column(root, "action").tobytes()
    assert len(result.notes) == 2
    assert all("not in the dataset" in note for note in result.notes)


def test_arms_get_their_observations_names(tmp_path: Path) -> None:
    source = v2.write_dataset(tmp_path / "in", (6,), cameras=contract.CAMERAS[:1], extras=False)
    arm = ["eef_x", "eef_y", "eef_z", "eef_qx", "eef_qy", "eef_qz", "eef_qw", "finger_1"]
    names = [*arm, *(f"robot1_{name}" for name in arm)]

    def describe(info: dict[str, Any]) -> None:
        info["robot_type"] = "Panda+Panda"
        info["features"]["observation.state"]["names"] = names

    v2.edit_json(source / "meta" / "info.json", describe)
    root = convert([source], tmp_path / "data", SETTINGS, workers=1).root
    found = items(export(root, tmp_path / "out.hdf5").path)
    states = column(root, "observation.state")
    assert found["data/demo_0/obs/robot0_eef_quat"].tobytes() == states[:, 3:7].tobytes()
    assert found["data/demo_0/obs/robot1_gripper_qpos"].tobytes() == states[:, 15:].tobytes()
    assert "data/demo_0/obs/state" not in found


def test_textures_come_from_the_dataset_itself_once_the_recording_is_gone(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "OpenDrawer.hdf5", (4,), images=16)
    root = convert([source], tmp_path / "data", SETTINGS, workers=1).root
    before = {name: value.tobytes() for name, value in items(source).items() if name.startswith("assets/")}
    source.unlink()
    result = export(root, tmp_path / "again.hdf5", ExportSettings(images=False))
    after = {name: value.tobytes() for name, value in items(result.path).items() if name.startswith("assets/")}
    assert before
    assert after == before
    assert not result.notes
    assert convert([result.path], tmp_path / "drawn", SETTINGS, workers=1).num_episodes == 1


def test_columns_that_were_kept_beside_the_data_are_written_once(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "OpenDrawer.hdf5", (4,), images=16)
    columns = ("dones", "obs/robot0_gripper_qpos")
    with h5py.File(source, "r+") as file:
        file["data/demo_0/dones"] = np.array([0, 1, 0, 1])  # not what the export would say by itself
    root = convert([source], tmp_path / "data", ConversionSettings(extra_columns=columns), workers=1).root
    found, true = items(export(root, tmp_path / "again.hdf5").path), items(source)
    for name in columns:
        np.testing.assert_array_equal(found[f"data/demo_0/{name}"], true[f"data/demo_0/{name}"])


def test_an_export_says_nothing_of_a_licence_that_it_does_not_know(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "OpenDrawer.hdf5", (4,), images=16)
    exported = export(convert([source], tmp_path / "data", SETTINGS, workers=1).root, tmp_path / "again.hdf5").path
    again = convert([exported], tmp_path / "again", SETTINGS, workers=1).root
    assert "license: other" in (again / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("by", "licence"), [({}, "apache-2.0"), ({"recorded_by": "teleop"}, "other")])
def test_what_people_drove_is_theirs_to_license(tmp_path: Path, by: dict[str, str], licence: str) -> None:
    source = write_demos(tmp_path / "OpenDrawer.hdf5", (4,), images=16)
    with h5py.File(source, "r+") as file:
        file["data"].attrs["recording_settings"] = json.dumps({"task": "OpenDrawer", **by})
    root = convert([source], tmp_path / "data", SETTINGS, workers=1).root
    assert f"license: {licence}" in (root / "README.md").read_text(encoding="utf-8")


def test_datasets_of_several_tasks_are_exported_one_by_one(tmp_path: Path) -> None:
    files = [
        write_demos(tmp_path / f"{name}.hdf5", (4,), images=16, env_name=name, seed=seed)
        for seed, name in enumerate(("A", "B"))
    ]
    root = convert(files, tmp_path / "data", SETTINGS, workers=1).root
    with pytest.raises(UserError, match=r"episodes of 2 tasks \(A, B\)"):
        export(root, tmp_path / "out.hdf5")
    with pytest.raises(UserError, match="unknown task 'a'"):
        export(root, tmp_path / "out.hdf5", ExportSettings(task="a"))
    assert not list(tmp_path.glob("out*"))
    path = export(root, tmp_path / "out.hdf5", ExportSettings(task="B")).path
    with h5py.File(path) as file:
        assert file["data"].attrs["env"] == "B"
        assert list(file["data"]) == ["demo_0"]
        assert list(file["assets"]) == ["textures"]
    assert items(path)["data/demo_0/actions"].tobytes() == items(files[1])["data/demo_0/actions"].tobytes()


def test_an_existing_file_is_replaced_only_if_asked_for(ours: tuple[Path, Path, Path], tmp_path: Path) -> None:
    out = tmp_path / "out.hdf5"
    out.write_text("mine")
    with pytest.raises(UserError, match="exists already"):
        export(ours[1], out)
    assert out.read_text() == "mine"
    export(ours[1], out, ExportSettings(cameras=contract.CAMERAS[:1]), overwrite=True)
    assert sum(name.endswith("_image") for name in items(out)) == 3
    with pytest.raises(UserError, match="unknown camera 'eye'"):
        export(ours[1], tmp_path / "b.hdf5", ExportSettings(cameras=("eye",)))
    with pytest.raises(UserError, match="name each camera once"):
        ExportSettings(cameras=contract.CAMERAS[:1] * 2)
    with pytest.raises(UserError, match="is a folder: name an HDF5 file"):
        export(ours[1], tmp_path, overwrite=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.hdf5"]


def test_damaged_datasets_leave_nothing(ours: tuple[Path, Path, Path], tmp_path: Path) -> None:
    def attempt(match: str) -> None:
        with pytest.raises(UserError, match=match):
            export(copy, tmp_path / "out.hdf5")
        assert not list(tmp_path.glob("out.hdf5*"))
        shutil.rmtree(copy)

    copy = tmp_path / "copy"
    shutil.copytree(ours[1], copy)
    (video,) = (copy / "videos" / contract.IMAGE_KEYS[0]).glob("*/*.mp4")
    v2.write_video(video, v2.moving_pictures(sum(LENGTHS) - 1, 32), v2.TARGET)
    attempt("lacks frame 8 of episode 2, which has 9")
    shutil.copytree(ours[1], copy)
    (table,) = (copy / "data").glob("*/*.parquet")
    v2.truncate(table, 0.5)
    attempt("cannot be read")
    shutil.copytree(ours[1], copy)
    v2.edit_json(copy / "meta" / "info.json", lambda info: info.update(codebase_version="v2.1"))
    attempt("version v2.1; v3.0 is needed")
    copy.mkdir()
    attempt("is no LeRobot dataset")


@pytest.mark.parametrize("name", ["states.npz", "model.xml.gz"])
def test_damaged_extras_are_named(name: str, ours: tuple[Path, Path, Path], tmp_path: Path) -> None:
    copy = Path(shutil.copytree(ours[1], tmp_path / "copy"))
    damaged = sorted((copy / "extras").glob(f"*/{name}"))[1]
    v2.truncate(damaged, 0.5)
    with pytest.raises(UserError, match=rf"episode 1: its extras/{name} cannot be used .* Copy this file again"):
        export(copy, tmp_path / "out.hdf5")
    assert not list(tmp_path.glob("out.hdf5*"))
    damaged.unlink()
    assert any("1 episodes are not in the dataset" in note for note in export(copy, tmp_path / "out.hdf5").notes)


def test_cameras_that_were_placed_after_the_recording_are_told(ours: tuple[Path, Path, Path], tmp_path: Path) -> None:
    assert not any("placed" in note for note in export(ours[1], tmp_path / "plain.hdf5").notes)
    copy = Path(shutil.copytree(ours[1], tmp_path / "copy"))

    def rendered_again(record: dict[str, Any]) -> None:  # what `render` writes
        record["settings"] = {"cam_configs": {"above": {"pos": [1, 0, 3]}}}

    v2.edit_json(copy / META_FOLDER / "conversion.json", rendered_again)
    (note,) = export(copy, tmp_path / "again.hdf5").notes
    assert "cameras above were placed when the pictures were rendered again" in note


def test_pictures_are_decoded_one_by_one(ours: tuple[Path, Path, Path]) -> None:
    dataset = ExportedDataset(ours[1])
    pictures = dataset.pictures(dataset.episodes[2], contract.CAMERAS[1])
    assert next(pictures).shape == (32, 32, 3)
    assert sum(1 for _ in pictures) == LENGTHS[2] - 1


def test_command(ours: tuple[Path, Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.hdf5"
    assert cli.main(["export", str(ours[1]), "--out", str(out), "--no-images"]) == 0
    assert f"3 episodes, {sum(LENGTHS)} frames" in capsys.readouterr().out
    assert out.is_file()
    assert cli.main(["export", str(ours[1]), "--out", str(tmp_path / "b.hdf5"), "--cameras", ""]) == 2
    assert "names no camera" in capsys.readouterr().err
    assert not (tmp_path / "b.hdf5").exists()
