"""Conversion and verification on small files in this project's layout: round trips, rejects, resuming."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from convert_support import INSTRUCTION, leftovers, tree_hashes, write_demos
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert import pipeline
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings, Plan, Shard
from robocasa_lerobot.convert.shard import ShardOutcome
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.convert.writing.statistics import column
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

SETTINGS = ConversionSettings()


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A file with pictures and the dataset made from it."""
    folder = tmp_path_factory.mktemp("stored")
    source = write_demos(folder / "OpenDrawer.hdf5", (40, 1, 60), images=64)
    convert([source], folder / "data", SETTINGS)
    return source, folder / "data"


@pytest.fixture
def copy(stored: tuple[Path, Path], tmp_path: Path) -> Path:
    """A copy of that dataset to be tampered with; its source is found by its recorded absolute path."""
    return Path(shutil.copytree(stored[1], tmp_path / "copy"))


def test_stored_pictures_round_trip(stored: tuple[Path, Path]) -> None:
    report = verify(stored[1], pictures_per_episode=None)
    assert report.passed, report.as_json()
    assert (report.num_episodes, report.num_frames) == (3, 101)
    assert {camera.camera for camera in report.cameras} == set(contract.CAMERAS)
    assert all(len(camera.psnr_db) == 101 for camera in report.cameras)
    compared = {check.name: check.compared for check in report.checks}
    assert compared["actions"] == 101 * contract.ACTION_SIZE
    assert compared["states"] == 101 * contract.STATE_SIZE
    assert min(compared.values()) > 0


def test_dataset_has_the_contracts_features_and_values(stored: tuple[Path, Path]) -> None:
    source, root = stored
    dataset = LeRobotDataset("local/test", root=root, video_backend="pyav")
    for key, feature in contract.dataset_features((64, 64)).items():
        found = dataset.meta.features[key]
        assert (found["dtype"], tuple(found["shape"]), found["names"]) == tuple(feature.values())
    assert dataset.meta.robot_type == contract.ROBOT_TYPE
    assert dataset.fps == contract.CONTROL_HZ
    assert dataset[0]["task"] == INSTRUCTION
    with h5py.File(source) as file:
        actions = np.concatenate([file[f"data/demo_{i}/actions"][:] for i in range(3)])
        base = file["data/demo_2/obs/robot0_base_pos"][:]
    assert column(root, "action").tobytes() == contract.hdf5_to_stored(actions).tobytes()
    assert np.array_equal(column(root, "observation.state")[41:, contract.STATE_SLICES["base_position"]], base)


def test_statistics_are_those_of_all_frames(stored: tuple[Path, Path]) -> None:
    stats = json.loads((stored[1] / "meta" / "stats.json").read_text())
    for key in ("action", "observation.state"):
        values = column(stored[1], key)
        assert stats[key]["count"] == [len(values)]
        for name, expected in (
            ("mean", values.mean(0)),
            ("std", values.std(0)),
            ("q01", np.quantile(values, 0.01, axis=0)),
            ("q99", np.quantile(values, 0.99, axis=0)),
        ):
            np.testing.assert_allclose(stats[key][name], expected, rtol=1e-12, atol=1e-14)
    pictures = stats[contract.IMAGE_KEYS[0]]
    assert pictures["count"] == [40 + 1 + 50]
    assert np.shape(pictures["mean"]) == (3, 1, 1)
    assert 0 <= np.min(pictures["q01"]) < np.max(pictures["q99"]) <= 1


def test_records_and_extras(stored: tuple[Path, Path]) -> None:
    source, root = stored
    lines = read_jsonl(root / META_FOLDER / "episodes.jsonl")
    assert [line["length"] for line in lines] == [40, 1, 60]
    assert lines[2] | {"episode_index": 2, "task_name": "OpenDrawer", "source_demo": "demo_2"} == lines[2]
    assert lines[0]["instruction"] == INSTRUCTION
    assert lines[0]["source_file"] == str(source)
    states = np.load(root / "extras" / "episode_000002" / "states.npz")["states"]
    with h5py.File(source) as file:
        assert np.array_equal(states, file["data/demo_2/states"][:])
    record = json.loads((root / META_FOLDER / "conversion.json").read_text())
    assert record["settings"]["render_preset"] == "fast"
    assert leftovers(root) == [root.name]


@pytest.mark.costly
def test_result_does_not_depend_on_the_workers(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (251, 251), images=16)
    for workers in (1, 2):
        convert([source], tmp_path / f"out{workers}", SETTINGS, workers=workers)
    one, two = (tree_hashes(tmp_path / f"out{workers}") for workers in (1, 2))
    record = f"{META_FOLDER}/conversion.json"
    assert {k: v for k, v in one.items() if k != record} == {k: v for k, v in two.items() if k != record}


def test_two_files_and_no_recorded_instruction(tmp_path: Path) -> None:
    first = write_demos(
        tmp_path / "a" / "demo.hdf5", (5,), images=32, env_name="PickPlaceCounterToSink", instruction=None
    )
    second = write_demos(tmp_path / "b" / "demo.hdf5", (6,), images=32, instruction=None, seed=1)
    result = convert([first, second], tmp_path / "plain", SETTINGS)
    assert result.instruction_sources == {"environment name": 2}
    lines = read_jsonl(tmp_path / "plain" / META_FOLDER / "episodes.jsonl")
    assert [line["instruction"] for line in lines] == ["pick place counter to sink", "open drawer"]
    assert verify(tmp_path / "plain").passed
    told = convert([first], tmp_path / "told", ConversionSettings(instruction="do it", image_size=48))
    assert told.instruction_sources == {"--instruction": 1}
    dataset = LeRobotDataset("local/told", root=tmp_path / "told", video_backend="pyav")
    assert dataset[4]["task"] == "do it"
    assert dataset[4][contract.IMAGE_KEYS[0]].shape == (3, 48, 48)
    assert verify(tmp_path / "told").passed


@pytest.mark.render
def test_states_only_round_trip(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "demos.hdf5", (12, 9))
    settings = ConversionSettings(image_size=64)
    convert([source], tmp_path / "data", settings)
    report = verify(tmp_path / "data", pictures_per_episode=None)
    assert report.passed, report.as_json()
    item = LeRobotDataset("local/x", root=tmp_path / "data", video_backend="pyav", return_uint8=True)[5]
    for key in contract.IMAGE_KEYS:  # neither black nor the yellow of the collision shapes
        picture = item[key].permute(1, 2, 0).numpy().astype(int)
        assert picture.std() > 10
        assert not ((picture[..., 0] > 200) & (picture[..., 1] > 200) & (picture[..., 2] < 50)).any()


@pytest.mark.render
def test_computed_states_equal_recorded_ones(tmp_path: Path) -> None:
    settings = ConversionSettings(cameras=("robot0_eye_in_hand",), image_size=16)
    for name, proprioception in (("recorded", True), ("computed", False)):
        source = write_demos(tmp_path / f"{name}.hdf5", (10,), proprioception=proprioception)
        convert([source], tmp_path / name, settings)
    lines = [read_jsonl(tmp_path / name / META_FOLDER / "episodes.jsonl")[0] for name in ("recorded", "computed")]
    assert [line["state_source"] for line in lines] == ["observations", "computed from simulator states"]
    recorded, computed = (column(tmp_path / name, "observation.state") for name in ("recorded", "computed"))
    np.testing.assert_allclose(computed, recorded, atol=1e-12)


def _cut(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


def _empty(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_group("data")


def _not_demos(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_group("other")


BAD_FILES: dict[str, tuple[Callable[[Path], object], str]] = {
    "truncated": (_cut, "truncated"),
    "text": (lambda path: path.write_text("hello"), "not an HDF5 file"),
    "no demos": (_empty, "has no demos"),
    "no data": (_not_demos, "no group 'data'"),
    "missing": (Path.unlink, "does not exist"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_file_stops_before_anything_is_written(case: str, tmp_path: Path) -> None:
    good = write_demos(tmp_path / "good.hdf5", (5,), images=16)
    bad = write_demos(tmp_path / "bad.hdf5", (5,), images=16)
    spoil, message = BAD_FILES[case]
    spoil(bad)
    with pytest.raises(UserError, match=message) as caught:
        convert([good, bad], tmp_path / "out", SETTINGS)
    assert "bad.hdf5" in str(caught.value)
    assert leftovers(tmp_path / "out") == []


def _set(key: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[h5py.Group], None]:
    def spoil(demo: h5py.Group) -> None:
        values = change(demo[key][:])
        del demo[key]
        demo[key] = values

    return spoil


def _with(values: np.ndarray, value: float) -> np.ndarray:
    values[-1, 3] = value
    return values


def _virtual(demo: h5py.Group) -> None:
    del demo["actions"]
    demo.create_dataset("actions", shape=(10**9, 12), dtype="f8", chunks=(1024, 12))


BAD_DEMOS: dict[str, tuple[Callable[[h5py.Group], object], str]] = {
    "NaN action": (_set("actions", lambda v: _with(v, np.nan)), "NaN"),
    "infinite state": (_set("states", lambda v: _with(v, np.inf)), "NaN or infinite"),
    "NaN observation": (_set("obs/robot0_base_quat", lambda v: _with(v, np.nan)), "NaN or infinite"),
    "more states": (_set("states", lambda v: np.concatenate([v, v[:2]])), "unequal lengths"),
    "fewer observations": (_set("obs/robot0_base_pos", lambda v: v[:-1]), "unequal lengths"),
    "fewer pictures": (_set("obs/robot0_eye_in_hand_image", lambda v: v[:-1]), "unequal lengths"),
    "float pictures": (_set("obs/robot0_eye_in_hand_image", lambda v: v / 255.0), "uint8"),
    "no steps": (_set("actions", lambda v: v[:0]), "no steps"),
    "text actions": (_set("actions", lambda v: v.astype("S8")), "numbers"),
    "another robot": (_set("actions", lambda v: v[:, :7]), "7 numbers"),
    "absurd shape": (_virtual, "absurd"),
    "no actions": (lambda demo: demo.__delitem__("actions"), "'actions'"),
    "broken ep_meta": (lambda demo: demo.attrs.__setitem__("ep_meta", "{"), "not JSON"),
}


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset from a file with one good demo followed by every kind of bad one."""
    folder = tmp_path_factory.mktemp("spoilt")
    source = write_demos(folder / "demos.hdf5", [6] * (1 + len(BAD_DEMOS)), images=32)
    with h5py.File(source, "a") as file:
        for index, (spoil, _) in enumerate(BAD_DEMOS.values(), start=1):
            spoil(file[f"data/demo_{index}"])
    convert([source], folder / "data", SETTINGS)
    return folder / "data"


def test_good_episodes_convert_beside_bad_ones(spoilt: Path) -> None:
    report = verify(spoilt)
    assert report.passed, report.as_json()
    assert (report.num_episodes, report.num_frames) == (1, 6)


@pytest.mark.parametrize("case", BAD_DEMOS)
def test_bad_episode_is_rejected_with_its_reason(case: str, spoilt: Path) -> None:
    index = 1 + list(BAD_DEMOS).index(case)
    lines = {line["source_demo"]: line for line in read_jsonl(spoilt / META_FOLDER / "rejected.jsonl")}
    assert len(lines) == len(BAD_DEMOS)
    assert BAD_DEMOS[case][1] in lines[f"demo_{index}"]["reason"]


def test_no_good_episode_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "demos.hdf5", (6, 6), images=16)
    with h5py.File(source, "a") as file:
        for name in ("demo_0", "demo_1"):
            BAD_DEMOS["NaN action"][0](file[f"data/{name}"])
    with pytest.raises(UserError, match="NaN"):
        convert([source], tmp_path / "out", SETTINGS)
    with h5py.File(source, "a") as file:
        for name in ("demo_0", "demo_1"):  # found only while writing
            BAD_DEMOS["no actions"][0](file[f"data/{name}"])
            file[f"data/{name}/actions"] = np.zeros((6, 12))
            BAD_DEMOS["more states"][0](file[f"data/{name}"])
            del file[f"data/{name}/obs/robot0_eye_in_hand_image"]
    with pytest.raises(UserError):
        convert([source], tmp_path / "out", SETTINGS)
    assert leftovers(tmp_path / "out") == []


def test_damage_found_half_way_through_an_episode_rejects_only_it(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "demos.hdf5", (30, 8), images=32)
    key = f"data/demo_0/obs/{contract.CAMERAS[0]}_image"
    with h5py.File(source, "a") as file:
        pictures = file[key][:]
        del file[key]
        dataset = file.create_dataset(key, data=pictures, chunks=(1, 32, 32, 3), compression="gzip", fletcher32=True)
        file.flush()
        where = dataset.id.get_chunk_info(20).byte_offset
    with source.open("r+b") as stream:
        stream.seek(where)
        stream.write(b"\xff" * 16)
    result = convert([source], tmp_path / "out", SETTINGS)
    assert [line["source_demo"] for line in result.rejected] == ["demo_0"]
    assert "cannot be read" in result.rejected[0]["reason"]
    assert result.num_frames == 8
    assert verify(tmp_path / "out", pictures_per_episode=None).passed
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"README.md", "data", "extras", "meta", "videos"}


def test_unknown_camera_names_the_closest(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "demos.hdf5", (5,))
    with pytest.raises(UserError, match="robot0_agentview_left"):
        convert([source], tmp_path / "out", ConversionSettings(cameras=("robot0_agentview_lft",)))
    assert leftovers(tmp_path / "out") == []


def test_files_that_do_not_fit_together(tmp_path: Path) -> None:
    small = write_demos(tmp_path / "a.hdf5", (5,), images=16)
    large = write_demos(tmp_path / "b.hdf5", (5,), images=32)
    with pytest.raises(UserError, match="do not fit into one dataset"):
        convert([small, large], tmp_path / "out", SETTINGS)
    with pytest.raises(UserError, match="more than once"):
        convert([small, small], tmp_path / "out", SETTINGS)
    assert leftovers(tmp_path / "out") == []


def test_existing_output_is_replaced_only_when_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16)
    out = tmp_path / "out again"
    assert cli.main(["convert", str(source), "--out", str(out)]) == 0
    assert f"check it: robocasa-lerobot verify '{out}'" in capsys.readouterr().out  # can be typed as it is
    before = tree_hashes(out)
    assert cli.main(["convert", str(source), "--out", str(out)]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert tree_hashes(out) == before
    write_demos(source, (7,), images=16)
    nested = out / "by_hand" / "meta"
    nested.mkdir(parents=True)
    (nested / "info.json").write_text("{}")
    assert cli.main(["convert", str(source), "--out", str(out), "--overwrite"]) == 2
    assert "by_hand" in capsys.readouterr().err
    assert (nested / "info.json").exists()
    shutil.rmtree(out / "by_hand")
    assert cli.main(["convert", str(source), "--out", str(out), "--overwrite"]) == 0
    assert len(column(out, "index")) == 7
    assert leftovers(out) == ["out again"]
    other = tmp_path / "notes"
    other.mkdir()
    (other / "thesis.txt").write_text("years of work")
    assert cli.main(["convert", str(source), "--out", str(other), "--overwrite"]) == 2
    assert (other / "thesis.txt").exists()


def test_killed_conversion_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = write_demos(tmp_path / "a.hdf5", (501, 501, 501), images=16)
    out = tmp_path / "out"
    command = [
        sys.executable,
        "-m",
        "robocasa_lerobot.cli",
        "convert",
        str(source),
        "--out",
        str(out),
        "--workers",
        "1",
    ]
    process = subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 120
        while not list(tmp_path.glob("out.partial-*/executor/completions/00000")):
            assert process.poll() is None, "it ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.01)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert not out.exists()
    finished = {int(file.name) for file in tmp_path.glob("out.partial-*/executor/completions/*")}
    redone = []
    convert_shard = pipeline.convert_shard

    def noting(plan: Plan, shard: Shard, *rest: Any) -> ShardOutcome:
        redone.append(shard.demos)
        return convert_shard(plan, shard, *rest)

    monkeypatch.setattr(pipeline, "convert_shard", noting)
    convert([source], out, SETTINGS, workers=1)
    assert redone == [(f"demo_{i}",) for i in range(3) if i not in finished]
    assert leftovers(out) == ["out"]
    convert([source], tmp_path / "at_once", SETTINGS, workers=1)
    record = f"{META_FOLDER}/conversion.json"
    resumed, at_once = tree_hashes(out), tree_hashes(tmp_path / "at_once")
    assert resumed.pop(record)
    assert at_once.pop(record)
    assert resumed == at_once
