"""Verification notices what is wrong: every kind of damage to a good dataset makes it fail, at the right check."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from convert_support import write_demos

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl, write_jsonl

CAMERA = contract.CAMERAS[1]


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("good")
    source = write_demos(folder / "demos.hdf5", (20, 30), images=64)
    convert([source], folder / "data", ConversionSettings())
    return folder


@pytest.fixture
def damaged(good: Path, tmp_path: Path) -> Path:
    """A copy of source and dataset with which to do what one likes."""
    shutil.copytree(good, tmp_path, dirs_exist_ok=True)
    return tmp_path


def _change_table(root: Path, change: Callable[[dict[str, Any]], None]) -> None:
    file = next((root / "data").glob("*/*.parquet"))
    table = pq.read_table(file)
    columns = {name: np.array(table[name].to_pylist()) for name in table.column_names}
    change(columns)
    changed = {name: pa.array(list(columns[name]), type=table.schema.field(name).type) for name in table.column_names}
    pq.write_table(pa.table(changed, schema=table.schema), file)


def _change_video(root: Path, change: Callable[[list[np.ndarray]], list[np.ndarray]]) -> None:
    file = next((root / "videos" / contract.image_key(CAMERA)).glob("*/*.mp4"))
    with av.open(str(file)) as container:
        frames = change([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])
    with av.open(str(file), "w") as container:
        stream = container.add_stream("h264", contract.VIDEO_FPS, options={"crf": "10", "g": "2"})
        stream.height, stream.width = frames[0].shape[:2]
        for index, frame in enumerate(frames):
            picture = av.VideoFrame.from_ndarray(frame, format="rgb24")
            picture.pts = index
            container.mux(stream.encode(picture))
        container.mux(stream.encode())


def _next_float(columns: dict[str, Any]) -> None:
    columns["action"][33, 7] = np.nextafter(columns["action"][33, 7], 2)


def _sign_of_zero(columns: dict[str, Any]) -> None:
    where = tuple(np.argwhere((columns["action"] == 0) & np.signbit(columns["action"]))[0])
    columns["action"][where] = 0.0


def _swap_actions(columns: dict[str, Any]) -> None:
    columns["action"][[3, 4]] = columns["action"][[4, 3]]


def _shift_state(columns: dict[str, Any]) -> None:
    columns["observation.state"][5, 0] += 1e-12


def _shift_time(columns: dict[str, Any]) -> None:
    columns["timestamp"][7] += 1e-4


def _renumber(columns: dict[str, Any]) -> None:
    columns["frame_index"][[7, 8]] = columns["frame_index"][[8, 7]]


def _swap(frames: list[np.ndarray]) -> list[np.ndarray]:
    frames[22], frames[41] = frames[41], frames[22]
    return frames


def _drop(frames: list[np.ndarray]) -> list[np.ndarray]:
    return frames[:25] + frames[26:]


def _upside_down(frames: list[np.ndarray]) -> list[np.ndarray]:
    return [np.ascontiguousarray(frame[::-1]) for frame in frames]


def _black(frames: list[np.ndarray]) -> list[np.ndarray]:
    return [*frames[:30], np.zeros_like(frames[0]), *frames[31:]]


def _other_instruction(root: Path) -> None:
    file = root / META_FOLDER / "episodes.jsonl"
    lines = read_jsonl(file)
    lines[1]["instruction"] = "something else"
    write_jsonl(file, lines)


def _change_source(root: Path) -> None:
    with h5py.File(root.parent / "demos.hdf5", "a") as file:
        file["data/demo_0/actions"][2, 2] += 0.5


def _add_demo(root: Path) -> None:
    with h5py.File(root.parent / "demos.hdf5", "a") as file:
        file.copy("data/demo_0", "data/demo_9")


def _table(change: Callable[[dict[str, Any]], None]) -> Callable[[Path], None]:
    return lambda root: _change_table(root, change)


def _video(change: Callable[[list[np.ndarray]], list[np.ndarray]]) -> Callable[[Path], None]:
    return lambda root: _change_video(root, change)


DAMAGES: dict[str, tuple[Callable[[Path], None], str]] = {
    "one action by one unit in the last place": (_table(_next_float), "actions"),
    "the sign of a zero": (_table(_sign_of_zero), "actions"),
    "two rows of actions swapped": (_table(_swap_actions), "actions"),
    "one state component": (_table(_shift_state), "states"),
    "one timestamp": (_table(_shift_time), "timestamps"),
    "frame indices swapped": (_table(_renumber), "frames"),
    "two frames swapped": (_video(_swap), "pictures"),
    "one frame black": (_video(_black), "pictures"),
    "upside down": (_video(_upside_down), "pictures"),
    "one frame dropped": (_video(_drop), "video frames"),
    "instruction": (_other_instruction, "instructions"),
    "source changed": (_change_source, "source files"),
    "demo left out": (_add_demo, "episodes"),
}


@pytest.mark.costly
@pytest.mark.parametrize("case", DAMAGES)
def test_damage_is_noticed(case: str, damaged: Path) -> None:
    damage, name = DAMAGES[case]
    root = damaged / "data"
    damage(root)
    report = verify(root, [damaged / "demos.hdf5"], pictures_per_episode=None)
    failed = [check.name for check in report.checks if not check.passed]
    assert name in failed
    assert not report.passed
    assert next(check for check in report.checks if check.name == name).differences


@pytest.mark.parametrize(
    "case",
    ["one action by one unit in the last place", pytest.param("two frames swapped", marks=pytest.mark.slow)],
)
def test_several_processes_find_the_same(case: str, damaged: Path) -> None:
    DAMAGES[case][0](damaged / "data")
    alone, several = (verify(damaged / "data", [damaged / "demos.hdf5"], workers=number) for number in (1, 2))
    assert not alone.passed
    assert several.as_json() == alone.as_json()


def test_undamaged_copy_passes_with_its_source_moved(damaged: Path) -> None:
    moved = (damaged / "demos.hdf5").rename(damaged / "elsewhere.hdf5")
    assert verify(damaged / "data", [moved], pictures_per_episode=None).passed


def test_one_source_that_was_moved_leaves_the_others_where_they_are(tmp_path: Path) -> None:
    files = [write_demos(tmp_path / name, (4,), images=64, seed=seed) for seed, name in enumerate(("a.hdf5", "b.hdf5"))]
    root = convert(files, tmp_path / "data", ConversionSettings(), workers=1).root
    moved = files[1].rename(tmp_path / "elsewhere.hdf5")
    assert verify(root, [moved]).passed
    with pytest.raises(UserError, match=r"b\.hdf5 is not there any more"):
        verify(root, [files[0]])


def test_given_sources_of_one_name_are_not_taken_for_each_other(tmp_path: Path) -> None:
    files = [write_demos(tmp_path / name / "demo.hdf5", (4,), images=64, seed=i) for i, name in enumerate("ab")]
    root = convert(files, tmp_path / "data", ConversionSettings(), workers=1).root
    assert verify(root, [files[0]]).passed  # the other one is where it was
    assert verify(root, files[::-1]).passed


def test_exit_status_and_outputs(damaged: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["verify", str(damaged / "data"), "--source", str(damaged / "demos.hdf5"), "--pictures-per-episode"]
    assert cli.main([*command, "3", "--workers", "2"]) == 0
    table = capsys.readouterr().out
    assert "PASSED" in table
    assert all(camera in table for camera in contract.CAMERAS)
    _change_table(damaged / "data", _next_float)
    assert cli.main([*command, "all", "--report", "json"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert not report["passed"]
    actions = next(check for check in report["checks"] if check["name"] == "actions")
    assert actions["num_differences"] == 1
    assert "episode 1 (demo_1) step 13" in actions["differences"][0]
    assert report["cameras"][0]["psnr_min_db"] > 25


def test_what_is_no_dataset_of_ours_is_refused(good: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no dataset"):
        verify(tmp_path)
    with pytest.raises(UserError, match="--workers is 0"):
        verify(good / "data", workers=0)
    copy = Path(shutil.copytree(good / "data", tmp_path / "copy"))
    with pytest.raises(UserError, match="--source"):
        verify(copy, [copy / "nothing.hdf5"])
    shutil.rmtree(copy / META_FOLDER)
    with pytest.raises(UserError, match="without our records"):
        verify(copy)


def test_unopenable_dataset_is_an_error_in_words(damaged: Path) -> None:
    file = next((damaged / "data" / "data").glob("*/*.parquet"))
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(UserError, match="LeRobot does not open"):
        verify(damaged / "data", [damaged / "demos.hdf5"])
