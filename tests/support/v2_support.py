"""Small LeRobot v2.0 and v2.1 datasets in RoboCasa365's layout, with tiny videos."""

from __future__ import annotations

import gzip
import json
import shutil
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from convert_support import SCENE, moving_pictures
from numpy.typing import NDArray

from robocasa_lerobot import contract

INSTRUCTIONS = ("Öffne die Schublade: 引き出し", "close the drawer")
TASK_NAME = "OpenDrawer"
FPS = contract.VIDEO_FPS
SIZE = 64
# The form that this project writes; RoboCasa365's own videos are h264 with default options: B-frames, GOP 250.
TARGET = {"bf": "0", "g": "2", "crf": "18"}
ROBOCASA = {"crf": "23"}


def write_video(path: Path, pictures: NDArray[np.uint8], options: dict[str, str], codec: str = "h264") -> None:
    """Encode pictures (T, H, W, 3)."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(codec, FPS, options=options)
        stream.height, stream.width, stream.pix_fmt = *pictures.shape[1:3], "yuv420p"
        stream.time_base = Fraction(1, FPS)
        for index, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = index, Fraction(1, FPS)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def write_dataset(
    root: Path,
    lengths: Sequence[int] = (12, 9),
    *,
    version: str = "v2.1",
    options: dict[str, str] | None = None,
    cameras: Sequence[str] = contract.CAMERAS,
    extras: bool = True,
    seed: int = 0,
) -> Path:
    """Write a dataset with an episode for each length; instructions alternate, the task-name row is the last."""
    rng = np.random.default_rng(seed)
    rows = [*INSTRUCTIONS[: max(1, min(2, len(lengths)))], TASK_NAME]
    lines, start = [], 0
    for index, length in enumerate(lengths):
        row = index % (len(rows) - 1)
        write_table(root, index, _columns(index, length, start, row, len(rows) - 1, rng))
        for offset, camera in enumerate(cameras):
            pictures = moving_pictures(length, SIZE, (offset + index) % 5)
            write_video(video(root, index, camera), pictures, TARGET if options is None else options)
        if extras:
            _write_extras(root, index, length, rows[row], rng)
        lines.append({"episode_index": index, "tasks": [rows[row]], "length": length})
        start += length
    _jsonl(root / "meta" / "episodes.jsonl", lines)
    _jsonl(root / "meta" / "tasks.jsonl", [{"task_index": i, "task": text} for i, text in enumerate(rows)])
    _write_info(root, version, lengths, cameras)
    if version == "v2.1":
        _jsonl(root / "meta" / "episodes_stats.jsonl", [{"episode_index": i, "stats": {}} for i in range(len(lengths))])
    else:
        _json(root / "meta" / "stats.json", {})
    _write_modality(root, cameras)
    if extras:
        _json(root / "meta" / "embodiment.json", {"robot_type": contract.ROBOT_TYPE, "body_frequency": 20.0})
        env_args = json.dumps({"env_name": TASK_NAME, "env_kwargs": {"control_freq": FPS}})
        _json(root / "extras" / "dataset_meta.json", {"env": TASK_NAME, "env_args": env_args})
    return root


def table(root: Path, index: int) -> Path:
    """An episode's parquet file."""
    return root / "data" / "chunk-000" / f"episode_{index:06d}.parquet"


def video(root: Path, index: int, camera: str) -> Path:
    """An episode's video."""
    return root / "videos" / "chunk-000" / contract.image_key(camera) / f"episode_{index:06d}.mp4"


def write_table(root: Path, index: int, columns: dict[str, Any]) -> None:
    """Write an episode's columns."""
    path = table(root, index)
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(columns), path)


def read_columns(root: Path, index: int) -> dict[str, Any]:
    """An episode's columns as Arrow arrays."""
    read = pq.ParquetFile(table(root, index)).read()
    return {name: read[name].combine_chunks() for name in read.column_names}


def edit_table(root: Path, index: int, change: Callable[[dict[str, Any]], None]) -> None:
    """Change an episode's columns in place."""
    columns = read_columns(root, index)
    change(columns)
    write_table(root, index, columns)


def edit_json(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change a JSON object in place."""
    value = json.loads(path.read_text(encoding="utf-8"))
    change(value)
    _json(path, value)


def truncate(path: Path, share: float) -> None:
    """Keep only the first part of a file."""
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * share)])


def vectors(values: NDArray[Any]) -> pa.Array:
    """(T, k) as lists."""
    return pa.array(list(values), pa.list_(pa.from_numpy_dtype(values.dtype)))


def _columns(index: int, length: int, start: int, row: int, name_row: int, rng: np.random.Generator) -> dict[str, Any]:
    actions = rng.uniform(-1, 1, (length, contract.ACTION_SIZE))
    actions[0, 0] = -0.0  # to be kept, bit for bit
    done = np.arange(length) == length - 1
    return {
        "annotation.human.task_description": np.full(length, row),
        "annotation.human.task_name": np.full(length, name_row),
        "observation.state": vectors(rng.normal(size=(length, contract.STATE_SIZE))),
        "action": vectors(actions),
        "next.reward": done.astype(np.float32),
        "next.done": done,
        "timestamp": (np.arange(length) / FPS).astype(np.float32),
        "frame_index": np.arange(length),
        "episode_index": np.full(length, index),
        "index": np.arange(start, start + length),
        "task_index": np.full(length, row),
    }


def _write_info(root: Path, version: str, lengths: Sequence[int], cameras: Sequence[str]) -> None:
    scalar = {"names": None, "shape": [1]}
    features: dict[str, Any] = {
        contract.image_key(camera): {
            "dtype": "video",
            "shape": [SIZE, SIZE, 3],
            "names": ["height", "width", "channel"],
            "info": {"video.fps": FPS, "video.codec": "h264", "video.pix_fmt": "yuv420p", "video.is_depth_map": False},
        }
        for camera in cameras
    }
    features |= {
        "annotation.human.task_description": {"dtype": "int64", **scalar},
        "annotation.human.task_name": {"dtype": "int64", **scalar},
        "observation.state": {"dtype": "float64", "shape": [contract.STATE_SIZE], "names": None},
        "action": {"dtype": "float64", "shape": [contract.ACTION_SIZE], "names": None},
        "next.reward": {"dtype": "float32", **scalar},
        "next.done": {"dtype": "bool", **scalar},
        "timestamp": {"dtype": "float32", **scalar},
        **{key: {"dtype": "int64", **scalar} for key in ("frame_index", "episode_index", "index", "task_index")},
    }
    _json(
        root / "meta" / "info.json",
        {
            "codebase_version": version,
            "robot_type": contract.ROBOT_TYPE,
            "total_episodes": len(lengths),
            "total_frames": sum(lengths),
            "total_chunks": 1,
            "chunks_size": 1000,
            "fps": FPS,
            "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
            "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
            "features": features,
        },
    )


def _write_modality(root: Path, cameras: Sequence[str]) -> None:
    def parts(slices: dict[str, slice], key: str) -> dict[str, Any]:
        return {n: {"original_key": key, "start": where.start, "end": where.stop} for n, where in slices.items()}

    _json(
        root / "meta" / "modality.json",
        {
            "state": parts(contract.STATE_SLICES, "observation.state"),
            "action": parts(contract.ACTION_SLICES, "action"),
            "video": {camera: {"original_key": contract.image_key(camera)} for camera in cameras},
            # RoboCasa365's own: the task's name is not declared.
            "annotation": {"human.task_description": {"original_key": "annotation.human.task_description"}},
        },
    )


def _write_extras(root: Path, index: int, length: int, instruction: str, rng: np.random.Generator) -> None:
    folder = root / "extras" / f"episode_{index:06d}"
    _json(folder / "ep_meta.json", {"layout_id": 3, "style_id": 5 + index, "lang": instruction})
    (folder / "model.xml.gz").write_bytes(gzip.compress(SCENE.encode(), mtime=0))
    np.savez_compressed(folder / "states.npz", states=rng.normal(size=(length, 11)))


def _json(path: Path, value: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=4, ensure_ascii=False), encoding="utf-8")


def _jsonl(path: Path, lines: list[dict[str, Any]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(json.dumps(line, ensure_ascii=False) + "\n" for line in lines), encoding="utf-8")


def clone(source: Path, target: Path) -> Path:
    """A copy of a dataset to be changed."""
    return Path(shutil.copytree(source, target))
