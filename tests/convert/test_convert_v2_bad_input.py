"""LeRobot v2 datasets with something wrong: an episode is rejected with its reason, or nothing is written at all."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import v2_support as v2
from convert_support import leftovers, write_demos

from robocasa_lerobot import contract
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.convert.writing.video import digests
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

CAMERA = contract.CAMERAS[0]
LENGTHS = (24, 15, 9)
BAD = 1
SETTINGS = ConversionSettings()
Damage = Callable[[Path], None]
EpisodeDamage = Callable[[Path, int], None]


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return v2.write_dataset(tmp_path_factory.mktemp("good") / "lerobot", LENGTHS, cameras=[CAMERA])


def column(name: str, change: Callable[[np.ndarray[Any, Any]], Any]) -> EpisodeDamage:
    """Replace a column of the damaged episode."""

    def damage(root: Path, index: int) -> None:
        def edit(columns: dict[str, Any]) -> None:
            values = np.array(columns[name].to_pylist())
            changed = change(values)
            columns[name] = v2.vectors(changed) if isinstance(changed, np.ndarray) and changed.ndim == 2 else changed

        v2.edit_table(root, index, edit)

    return damage


def without(name: str) -> EpisodeDamage:
    def damage(root: Path, index: int) -> None:
        v2.edit_table(root, index, lambda columns: columns.pop(name))

    return damage


def put(value: Any, *where: int) -> Callable[[np.ndarray[Any, Any]], np.ndarray[Any, Any]]:
    def change(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        values = values.copy()
        values[where] = value
        return values

    return change


def shortened(root: Path, index: int) -> None:
    v2.edit_table(root, index, lambda columns: columns.update({k: v[:-1] for k, v in columns.items()}))


def zero_steps(root: Path, index: int) -> None:
    v2.edit_table(root, index, lambda columns: columns.update({k: v[:0] for k, v in columns.items()}))


def ragged(root: Path, index: int) -> None:
    def edit(columns: dict[str, Any]) -> None:
        rows = columns["action"].to_pylist()
        columns["action"] = pa.array([*rows[:-1], rows[-1][:-1]])

    v2.edit_table(root, index, edit)


def nulls(root: Path, index: int) -> None:
    def edit(columns: dict[str, Any]) -> None:
        rows = columns["action"].to_pylist()
        rows[2][3] = None
        columns["action"] = pa.array(rows)

    v2.edit_table(root, index, edit)


def scrambled_video(root: Path, index: int) -> None:
    path = v2.video(root, index, CAMERA)
    content = bytearray(path.read_bytes())
    start = len(content) // 2  # behind the codec's own remarks
    content[start : start + 400] = np.random.default_rng(0).bytes(400)
    path.write_bytes(content)


def scrambled_model(root: Path, index: int) -> None:
    path = root / f"extras/episode_{index:06d}/model.xml.gz"
    content = bytearray(path.read_bytes())
    content[20:28] = b"\xff" * 8  # in what is deflated
    path.write_bytes(content)


def video_of(length: int) -> EpisodeDamage:
    def damage(root: Path, index: int) -> None:
        v2.write_video(v2.video(root, index, CAMERA), v2.moving_pictures(length, v2.SIZE), v2.TARGET)

    return damage


def nonsense(root: Path, index: int) -> None:
    v2.table(root, index).write_bytes(b"PAR1" + b"\xff" * 64 + b"PAR1")


EPISODES: dict[str, tuple[EpisodeDamage, str]] = {
    "no table": (lambda root, index: v2.table(root, index).unlink(), "its table is missing"),
    "truncated table": (lambda root, index: v2.truncate(v2.table(root, index), 0.6), "cannot be read as parquet"),
    "table of nonsense": (nonsense, "cannot be read as parquet"),
    "NaN": (column("action", put(np.nan, 3, 1)), "action has 1 values that are NaN or infinite, the first at step 3"),
    "Inf": (column("next.reward", lambda v: put(np.inf, 7)(v).astype(np.float32)), "next.reward has 1 values"),
    "nulls": (nulls, "action has empty values"),
    "ragged rows": (ragged, "rows of [11, 12] numbers, expected 12"),
    "narrow action": (column("action", lambda v: v[:, :11]), "rows of [11] numbers, expected 12"),
    "wrong type": (column("action", lambda v: v.astype(np.float32)), "action is float32"),
    "text for numbers": (column("next.reward", lambda v: [str(x) for x in v]), "next.reward is object"),
    "no action": (without("action"), "has no column 'action'"),
    "fewer rows": (shortened, "unequal lengths: 15 in episodes.jsonl but 14 rows"),
    "no rows": (zero_steps, "it has no steps"),
    "frames out of order": (column("frame_index", lambda v: v[::-1].copy()), "frame_index does not count"),
    "rows of another episode": (column("episode_index", lambda v: v * 0), "its rows say they are of episode [0]"),
    "uneven times": (
        column("timestamp", lambda v: put(5.0, 4)(v).astype(np.float32)),
        "its times are not 20 steps a second: step 4",
    ),
    "unknown instruction": (column("annotation.human.task_description", lambda v: v * 0 + 9), "row 9 of tasks.jsonl"),
    "no video": (lambda root, index: v2.video(root, index, CAMERA).unlink(), "its video of observation.images.robot0"),
    "truncated video": (lambda root, index: v2.truncate(v2.video(root, index, CAMERA), 0.5), "cannot be read as video"),
    "empty video": (lambda root, index: v2.video(root, index, CAMERA).write_bytes(b""), "cannot be read as video"),
    "scrambled video": (scrambled_video, "damaged"),
    "short video": (video_of(14), "15 rows but 14 frames in the video"),
    "long video": (video_of(16), "15 rows but 16 decodable frames in the video"),
    "other states": (
        lambda root, index: np.savez(root / f"extras/episode_{index:06d}/states.npz", states=np.zeros((3, 4))),
        "extras/states.npz cannot be used (states are (3, 4), expected (15, n)",
    ),
    "pickled states": (
        lambda root, index: np.savez(root / f"extras/episode_{index:06d}/states.npz", states=np.array([{}])),
        "extras/states.npz cannot be used",
    ),
    "model is no gzip": (
        lambda root, index: [(root / f"extras/episode_{index:06d}/model.xml.gz").write_bytes(b"<mujoco/>"), None][1],
        "extras/model.xml.gz cannot be used",
    ),
    "half a file of states": (
        lambda root, index: v2.truncate(root / f"extras/episode_{index:06d}/states.npz", 0.5),
        "extras/states.npz cannot be used",
    ),
    "scrambled model": (scrambled_model, "extras/model.xml.gz cannot be used"),
    "ep_meta is no object": (
        lambda root, index: [(root / f"extras/episode_{index:06d}/ep_meta.json").write_text("[1]"), None][1],
        "its ep_meta.json is a JSON list",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def damaged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset made from one whose episodes are damaged, each in another way, but for the first and the last."""
    folder = tmp_path_factory.mktemp("damaged")
    source = v2.write_dataset(folder / "in", (15,) * (len(EPISODES) + 2), cameras=[CAMERA])
    for index, (damage, _) in enumerate(EPISODES.values(), start=1):
        damage(source, index)
    return convert([source], folder / "out", SETTINGS, workers=1).root


@pytest.mark.parametrize("name", EPISODES)
def test_a_bad_episode_is_rejected_with_its_reason(name: str, damaged: Path) -> None:
    index = list(EPISODES).index(name) + 1
    (reason,) = [
        line["reason"]
        for line in read_jsonl(damaged / META_FOLDER / "rejected.jsonl")
        if line["source_demo"] == f"episode_{index:06d}"
    ]
    assert EPISODES[name][1] in reason
    assert reason.count("its extras/") <= 1  # said once


def test_good_episodes_among_bad_ones_are_converted_whole(damaged: Path) -> None:
    lines = read_jsonl(damaged / META_FOLDER / "episodes.jsonl")
    assert [line["source_demo"] for line in lines] == ["episode_000000", f"episode_{len(EPISODES) + 1:06d}"]
    assert leftovers(damaged) == [damaged.name]
    (file,) = (damaged / "videos" / contract.image_key(CAMERA)).glob("*/*.mp4")
    source = damaged.parent / "in"
    assert digests(file) == [d for i in (0, len(EPISODES) + 1) for d in digests(v2.video(source, i, CAMERA))]
    assert verify(damaged, pictures_per_episode=3).passed


def test_what_was_rejected_is_part_of_the_verification(good: Path, tmp_path: Path) -> None:
    source = v2.clone(good, tmp_path / "in")
    v2.table(source, BAD).unlink()
    result = convert([source], tmp_path / "out", SETTINGS, workers=1)
    assert verify(result.root, pictures_per_episode=2).passed
    (result.root / META_FOLDER / "rejected.jsonl").write_text("")
    report = verify(result.root, pictures_per_episode=2)
    assert [check.name for check in report.checks if not check.passed] == ["episodes"]


def every(change: EpisodeDamage) -> Damage:
    """Damage every episode."""

    def damage(root: Path) -> None:
        for index in range(len(LENGTHS)):
            change(root, index)

    return damage


def info(**values: Any) -> Damage:
    return lambda root: v2.edit_json(root / "meta" / "info.json", lambda found: found.update(values))


def declare(dtype: str, key: str = "observation.images.other") -> Damage:
    feature = {"dtype": dtype, "shape": [64, 64, 3], "names": ["height", "width", "channel"]}
    return lambda root: v2.edit_json(
        root / "meta" / "info.json", lambda found: found["features"].update({key: feature})
    )


DATASETS: dict[str, tuple[Damage, str]] = {
    "version 3": (info(codebase_version="v3.0"), "of version 'v3.0'"),
    "version 1": (info(codebase_version="v1.6"), "of version 'v1.6'"),
    "half a frame per second": (info(fps=0.5), "fps 0.5"),
    "features of nonsense": (info(features={"action": 3}), "no usable 'features'"),
    "info is no JSON": (lambda root: v2.truncate(root / "meta" / "info.json", 0.5), "is not JSON"),
    "no tasks": (lambda root: (root / "meta" / "tasks.jsonl").unlink(), "tasks.jsonl is missing"),
    "no episodes": (lambda root: [(root / "meta" / "episodes.jsonl").write_text(""), None][1], "lists no episodes"),
    "truncated episodes": (lambda root: v2.truncate(root / "meta" / "episodes.jsonl", 0.99), "line 3 is not JSON"),
    "path out of the dataset": (info(data_path="../../{episode_index}.parquet"), "no path inside the dataset"),
    "absolute path": (info(video_path="/{video_key}/{episode_index}.mp4"), "no path inside the dataset"),
    "huge width": (info(data_path="{episode_index:0999999999d}.parquet"), "no path inside the dataset"),
    "attribute": (info(data_path="{episode_index.__class__}.parquet"), "no path inside the dataset"),
    "all tables missing": (every(lambda root, index: v2.table(root, index).unlink()), "no readable table"),
    "all videos missing": (
        every(lambda root, index: v2.video(root, index, CAMERA).unlink()), "has no camera with videos",
    ),
    "no action anywhere": (
        every(lambda root, index: v2.edit_table(root, index, lambda columns: columns.pop("action"))),
        "has no column 'action'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DATASETS)
def test_a_dataset_that_cannot_be_used_leaves_nothing(name: str, good: Path, tmp_path: Path) -> None:
    damage, reason = DATASETS[name]
    source = v2.clone(good, tmp_path / "in")
    damage(source)
    with pytest.raises(UserError, match=r".") as error:
        convert([source], tmp_path / "out", SETTINGS, workers=1)
    assert reason in str(error.value)
    assert leftovers(tmp_path / "out") == []


def test_cameras_without_videos_are_left_out_with_a_note_or_refused_if_asked_for(good: Path, tmp_path: Path) -> None:
    source = v2.clone(good, tmp_path / "in")
    declare("video")(source)
    declare("image", "observation.images.stored")(source)
    declare("video", "observation.images../../x")(source)
    result = convert([source], tmp_path / "out", SETTINGS, workers=1)
    assert result.cameras == (CAMERA,)
    assert [note.split(" is ")[0] for note in result.notes] == ["camera other", "camera stored", "camera ./../x"]
    assert verify(result.root, pictures_per_episode=1).passed
    with pytest.raises(UserError, match="camera other is declared but has no video files"):
        convert([source], tmp_path / "asked", ConversionSettings(cameras=("other",)), workers=1)
    with pytest.raises(UserError, match="Did you mean 'robot0_agentview_left'"):
        convert([source], tmp_path / "asked", ConversionSettings(cameras=("agentview_left",)), workers=1)
    assert leftovers(tmp_path / "asked") == []


def test_the_users_instruction_is_for_episodes_without_one(good: Path, tmp_path: Path) -> None:
    source = v2.clone(good, tmp_path / "in")
    EPISODES["unknown instruction"][0](source, BAD)
    result = convert([source], tmp_path / "out", ConversionSettings(instruction="open it"), workers=1)
    lines = read_jsonl(result.root / META_FOLDER / "episodes.jsonl")
    assert [line["instruction"] for line in lines] == [v2.INSTRUCTIONS[0], "open it", v2.INSTRUCTIONS[0]]
    assert verify(result.root, pictures_per_episode=1).passed
    everywhere = ConversionSettings(instruction="open it", replace_instruction=True)
    result = convert([source], tmp_path / "all", everywhere, workers=1)
    assert {line["instruction"] for line in read_jsonl(result.root / META_FOLDER / "episodes.jsonl")} == {"open it"}


def test_folders_and_hdf5_files_do_not_mix_and_hdf5_options_are_refused(good: Path, tmp_path: Path) -> None:
    demos = write_demos(tmp_path / "a.hdf5", (3,), images=16)
    with pytest.raises(UserError, match=r"is a LeRobot dataset and .* is not"):
        convert([good, demos], tmp_path / "out", SETTINGS)
    with pytest.raises(UserError, match="--action-key is for HDF5 files"):
        convert([good], tmp_path / "out", ConversionSettings(action_key="actions_abs"))
    with pytest.raises(UserError, match="--extra-columns is for HDF5 files"):
        convert([good], tmp_path / "out", ConversionSettings(extra_columns=("rewards",)))
    with pytest.raises(UserError, match=r"has the field \{obj\}"):
        convert([good], tmp_path / "out", ConversionSettings(instruction="take the {obj}"))
    assert leftovers(tmp_path / "out") == []


def test_a_dataset_given_twice_and_an_output_inside_it_are_refused(good: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="was given more than once"):
        convert([good, good], tmp_path / "out", SETTINGS)
    with pytest.raises(UserError, match="is inside the dataset"):
        convert([good], good / "v3", SETTINGS)
    with pytest.raises(UserError, match="nothing to take instead"):
        convert([good], tmp_path / "out", ConversionSettings(replace_instruction=True))
    assert leftovers(tmp_path / "out") == leftovers(good / "v3") == []


def test_datasets_of_different_robots_do_not_fit_together(good: Path, tmp_path: Path) -> None:
    other = v2.clone(good, tmp_path / "in")
    info(robot_type="GR1")(other)
    with pytest.raises(UserError, match="do not fit into one dataset: robot GR1 against PandaOmron"):
        convert([good, other], tmp_path / "out", SETTINGS)


TAMPERINGS: dict[str, tuple[str, str]] = {
    "a number": ("actions", "action"),
    "a reward": ("other columns", "next.reward"),
}


@pytest.mark.parametrize("name", ["a number", pytest.param("a reward", marks=pytest.mark.slow)])
def test_verify_finds_a_changed_number(name: str, good: Path, tmp_path: Path) -> None:
    check, key = TAMPERINGS[name]
    result = convert([good], tmp_path / "out", SETTINGS, workers=1)
    (path,) = (result.root / "data").glob("*/*.parquet")
    table = pq.ParquetFile(path).read()
    rows = table[key].to_pylist()
    if isinstance(rows[5], list):
        rows[5][2] += 1e-9
    else:
        rows[5] += 1
    changed = pa.array(rows, table.schema.field(key).type)
    pq.write_table(table.set_column(table.column_names.index(key), table.schema.field(key), changed), path)
    report = verify(result.root, pictures_per_episode=1)
    assert [check.name for check in report.checks if not check.passed] == [check]
    assert verify(result.root, pictures_per_episode=1, workers=2).as_json() == report.as_json()


def test_verify_finds_another_frame_and_other_extras(good: Path, tmp_path: Path) -> None:
    result = convert([good], tmp_path / "out", SETTINGS, workers=1)
    (path,) = (result.root / "videos" / contract.image_key(CAMERA)).glob("*/*.mp4")
    pictures = np.concatenate([v2.moving_pictures(n, v2.SIZE, i) for i, n in enumerate(LENGTHS)])
    v2.write_video(path, pictures, v2.TARGET | {"crf": "19"})
    (result.root / "extras" / "episode_000002" / "ep_meta.json").write_text(json.dumps({"lang": "other"}))
    failed = {check.name for check in verify(result.root, pictures_per_episode=1).checks if not check.passed}
    assert failed == {"copied frames", "extras"}
