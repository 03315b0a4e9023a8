"""The measured pieces of `convert_speed.py` that run in our environment; a process that answers commands.

Ours is the converter as users call it. The encoder alone, the renderer alone and LeRobot's own recording path are the
lines below, which share the codec options with the converter and nothing else: they are what anybody would write first.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import h5py
import lerobot.datasets.lerobot_dataset as lerobot_dataset
import mujoco
import numpy as np
import torch
from lerobot.configs import RGBEncoderConfig
from lerobot.datasets.video_utils import encode_video_frames
from lerobot.utils.collate import lerobot_collate_fn
from numpy.typing import NDArray
from peers import sim_loop

from robocasa_lerobot import contract
from robocasa_lerobot.convert import pipeline
from robocasa_lerobot.convert.reading.mjcf import AssetFinder, loadable
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.convert.writing.encoder import ENCODER_THREADS
from robocasa_lerobot.convert.writing.statistics import column
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.quiet import quiet_libraries

Picture = NDArray[np.uint8]
BATCH = 16
# RoboCasa's published videos: h264, crf 23, the codec's own keyframe distance.
OFFICIAL_VIDEO = {"vcodec": "h264", "crf": 23, "g": 250}


class Clock:
    """Seconds and processor seconds (of this process's threads and of children that have ended) since it was made."""

    def __init__(self) -> None:
        self._cpu, self._start = sum(os.times()[:4]), time.perf_counter()

    def taken(self) -> dict[str, float]:
        """As the fields of an answer."""
        return {"seconds": time.perf_counter() - self._start, "cpu_s": sum(os.times()[:4]) - self._cpu}


def hello() -> dict[str, Any]:
    """An answer, which says that everything is imported."""
    return {}


def convert(
    file: str,
    out: str,
    workers: int,
    cameras: list[str] | None = None,
    asset_roots: list[str] | None = None,
    preset: str = "fast",
    size: int | None = None,
) -> dict[str, Any]:
    """The converter, from the file to the finished dataset; `size` in pixels, None: as stored or usual."""
    shutil.rmtree(out, ignore_errors=True)
    settings = ConversionSettings(
        asset_roots=tuple(asset_roots or ()),
        cameras=None if cameras is None else tuple(cameras),
        render_preset=preset,
        image_size=size,
    )
    clock = Clock()
    result = pipeline.convert([Path(file)], Path(out), settings, workers)
    taken = clock.taken()
    assert not result.rejected, result.rejected[:1]
    return {**taken, "frames": result.num_frames, "mib": folder_mib(Path(out))}


def record_with_lerobot(file: str, reference: str, out: str, render: bool, alike: bool = False) -> dict[str, Any]:
    """LeRobot's `add_frame` / `save_episode` with its default settings; one process, as it is.

    With `alike` the codec and its options are those of `reference`, and pictures go to the encoder instead of to PNG
    files: what LeRobot's writer can do at best. Its queue takes a whole episode, since it drops what finds it full.
    Pictures come from the file, or are rendered state by state before they are handed over. Columns other than
    pictures, their names and the instructions are those of `reference`, a conversion of the same demos by us.
    """
    shutil.rmtree(out, ignore_errors=True)
    features, columns, tasks = _recorded(Path(reference))
    fps = json.loads((Path(reference) / "meta" / "info.json").read_text())["fps"]
    cameras = [key.removeprefix(contract.IMAGE_PREFIX) for key, f in features.items() if f["dtype"] == "video"]
    clock = Clock()
    row, rendering = 0, 0.0
    with h5py.File(file, "r") as source:
        how: dict[str, Any] = {}
        if alike:
            longest = max(len(source["data"][name]["actions"]) for name in _demo_names(source))
            how = {"rgb_encoder": _video_of(Path(reference)), "encoder_threads": ENCODER_THREADS}
            how |= {"streaming_encoding": True, "encoder_queue_maxsize": longest}
        dataset = lerobot_dataset.LeRobotDataset.create(
            "local/lerobot", fps, features, root=out, use_videos=True, **how
        )
        for name in _demo_names(source):
            scene = RecordedScene(source, name) if render else None
            group = source["data"][name]
            stored = {} if render else {camera: group[f"obs/{camera}_image"][:] for camera in cameras}
            for step in range(len(group["actions"])):
                before = time.perf_counter()
                pictures = scene.pictures(step, cameras) if scene else {c: stored[c][step] for c in cameras}
                rendering += time.perf_counter() - before
                frame: dict[str, Any] = {contract.image_key(camera): p for camera, p in pictures.items()}
                frame.update({key: values[row] for key, values in columns.items()})
                dataset.add_frame({**frame, contract.TASK_KEY: tasks[row]})
                row += 1
            dataset.save_episode()
            if scene:
                scene.close()
    dataset.finalize()
    taken = clock.taken()
    return {**taken, "frames": row, "rendering_s": rendering if render else 0.0, "mib": folder_mib(Path(out))}


class Encoding:
    """The encoder alone: pictures that lie in memory, one video for each camera and demo."""

    def __init__(self) -> None:
        self._pictures: dict[str, dict[str, NDArray[np.uint8]]] = {}
        self._video = RGBEncoderConfig()

    def load_pictures(self, file: str, demos: list[str], reference: str) -> dict[str, Any]:
        """Read the pictures of demos; codec and options are those of `reference`, a dataset of ours."""
        self._video = _video_of(Path(reference))
        with h5py.File(file, "r") as source:
            for name in demos:
                observations = source["data"][name]["obs"]
                keys = [key for key in observations if key.endswith("_image")]
                self._pictures[name] = {key: observations[key][:] for key in keys}
        return {"mib": sum(p.nbytes for demo in self._pictures.values() for p in demo.values()) / 2**20}

    def encode(self, demos: list[str], folder: str, at: float) -> dict[str, Any]:
        """Encode the pictures of demos from the instant `at` on."""
        shutil.rmtree(folder, ignore_errors=True)
        Path(folder).mkdir(parents=True)
        _wait_until(at)
        clock = Clock()
        frames = 0
        for name in demos:
            self._encode(self._pictures[name], Path(folder), name)
            frames += len(next(iter(self._pictures[name].values())))
        return {**clock.taken(), "frames": frames, "mib": folder_mib(Path(folder))}

    def _encode(self, pictures: dict[str, NDArray[np.uint8]], folder: Path, name: str) -> None:
        time_base = Fraction(1, contract.CONTROL_HZ)
        options = self._video.get_codec_options(ENCODER_THREADS, as_strings=True)
        videos = []
        with contextlib.ExitStack() as stack:
            for key, images in pictures.items():
                container = stack.enter_context(av.open(str(folder / f"{name}-{key}.mp4"), "w"))
                stream = container.add_stream(self._video.vcodec, contract.CONTROL_HZ, options=options)
                stream.pix_fmt = self._video.pix_fmt
                stream.height, stream.width = images.shape[1:3]
                videos.append((container, stream, images))
            # Step by step through all cameras, so that the codec's threads of all of them have work.
            for step in range(len(videos[0][2])):
                for container, stream, images in videos:
                    frame = av.VideoFrame.from_ndarray(images[step], format="rgb24")
                    frame.pts, frame.time_base = step, time_base
                    container.mux(stream.encode(frame))
            for container, stream, _ in videos:
                container.mux(stream.encode())


class RecordedScene:
    """The scene of a demo and its states, drawn by `SceneRenderer` with the converter's `fast` preset."""

    def __init__(self, source: h5py.File, name: str) -> None:
        group = source["data"][name]
        self._states = group["states"][:]

        def embedded(path: str) -> bytes | None:
            stored = source.get(f"assets/{path}")
            return None if stored is None else stored[()].tobytes()

        xml, assets = loadable(group.attrs["model_file"], AssetFinder([], embedded))
        self._model = mujoco.MjModel.from_xml_string(xml, assets)
        self._model.light_castshadow[:] = 0
        self._model.mat_reflectance[:] = 0
        self._model.vis.quality.offsamples = 0
        self._data = mujoco.MjData(self._model)
        self._renderer = SceneRenderer(self._model, contract.IMAGE_SIZE, contract.IMAGE_SIZE)

    def __len__(self) -> int:
        return len(self._states)

    def pictures(self, step: int, cameras: list[str]) -> dict[str, Picture]:
        """What cameras see at a step."""
        state = self._states[step]
        self._data.qpos[:] = state[1 : 1 + self._model.nq]
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        return {camera: self._renderer.render(self._data, camera) for camera in cameras}

    def close(self) -> None:
        """Release the OpenGL context."""
        self._renderer.close()


def render(file: str, demos: list[str], at: float) -> dict[str, Any]:
    """The renderer alone, from the instant `at` on: three pictures of each state, kept nowhere.

    Opening a scene (reading, compiling, a context) is counted apart from drawing.
    """
    _wait_until(at)
    loading, drawing, cpu, frames = 0.0, 0.0, 0.0, 0
    cameras = list(contract.CAMERAS)
    with h5py.File(file, "r") as source:
        for name in demos:
            clock = Clock()
            scene = RecordedScene(source, name)
            loading += clock.taken()["seconds"]
            clock = Clock()
            for step in range(len(scene)):
                scene.pictures(step, cameras)
            taken = clock.taken()
            drawing, cpu = drawing + taken["seconds"], cpu + taken["cpu_s"]
            frames += len(scene)
            scene.close()
    return {"frames": frames, "seconds": drawing, "cpu_s": cpu, "loading_s": loading}


def encode_png(folder: str, out: str) -> dict[str, Any]:
    """The other half of the official method: LeRobot's encoder over folders of PNG files, one after the other."""
    shutil.rmtree(out, ignore_errors=True)
    start = time.perf_counter()
    places = sorted(path for path in Path(folder).glob("*/*") if path.is_dir())
    for place in places:
        video = Path(out) / f"{place.parent.name}-{place.name}.mp4"
        encode_video_frames(place, video, contract.CONTROL_HZ, RGBEncoderConfig(**OFFICIAL_VIDEO), overwrite=True)
    return {"seconds": time.perf_counter() - start, "videos": len(places)}


def decode(root: str, batches: int, seed: int) -> dict[str, Any]:
    """Random batches of 16 through LeRobot's dataset and PyTorch's DataLoader, all cameras decoded."""
    dataset = lerobot_dataset.LeRobotDataset(f"local/{Path(root).name}", root=root)
    sampler = torch.utils.data.RandomSampler(
        dataset, replacement=True, num_samples=(batches + 1) * BATCH, generator=torch.Generator().manual_seed(seed)
    )
    loader = iter(
        torch.utils.data.DataLoader(
            dataset, batch_size=BATCH, sampler=sampler, num_workers=0, collate_fn=lerobot_collate_fn
        )
    )
    first = next(loader)  # opens the files
    cameras = [key for key in first if key.startswith(contract.IMAGE_PREFIX)]
    clock = Clock()
    for batch in loader:
        assert all(len(batch[key]) == BATCH for key in cameras)
    taken, size = clock.taken(), list(first[cameras[0]].shape)
    return {**taken, "frames": batches * BATCH, "cameras": len(cameras), "size": size}


def folder_mib(folder: Path) -> float:
    """Size of everything in a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 2**20


def _recorded(root: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]], list[str]]:
    """Features for a dataset of the same content, the rows of its columns, and the instruction of each row."""
    meta = lerobot_dataset.LeRobotDatasetMetadata(f"local/{root.name}", root=root)
    own = {"timestamp", "frame_index", "episode_index", "index", "task_index"}
    features = {
        key: {word: feature[word] for word in ("dtype", "shape", "names")}
        for key, feature in meta.features.items()
        if key not in own and feature["dtype"] != "language"  # stages, which its own commands do not record either
    }
    columns = {
        key: column(root, key).reshape(meta.total_frames, *feature["shape"])
        for key, feature in features.items()
        if feature["dtype"] != "video"
    }
    names = {int(row.task_index): str(task) for task, row in meta.tasks.iterrows()}
    return features, columns, [names[int(index)] for index in column(root, "task_index")]


def _video_of(root: Path) -> RGBEncoderConfig:
    """Codec and options of a dataset of ours."""
    return RGBEncoderConfig(**json.loads((root / "meta/robocasa/conversion.json").read_text())["video"])


def _demo_names(source: h5py.File) -> list[str]:
    names = [name for name in source["data"] if name.startswith("demo_")]
    return sorted(names, key=lambda name: int(name.removeprefix("demo_")))


def _wait_until(at: float) -> None:
    while (wait := at - time.perf_counter()) > 0:
        time.sleep(min(wait, 0.05))


def main() -> None:
    """Answer commands."""
    quiet_libraries()
    encoding = Encoding()
    sim_loop.answer_commands(
        hello, convert, record_with_lerobot, encoding.load_pictures, encoding.encode, render, encode_png, decode
    )


if __name__ == "__main__":
    main()
