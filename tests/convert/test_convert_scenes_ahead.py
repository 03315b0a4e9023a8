"""Scenes compiled in another process: the same as those compiled here, and nothing lost where that process fails."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import h5py
import mujoco
import numpy as np
import psutil
import pytest
from convert_support import SCENE, tree_hashes, write_demos

from robocasa_lerobot.convert import settings
from robocasa_lerobot.convert.pipeline import ConversionResult, convert
from robocasa_lerobot.convert.reading.demo_file import DemoFile
from robocasa_lerobot.convert.reading.layout import ROBOMIMIC
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.render import Scene
from robocasa_lerobot.convert.scenes.compiled import CompiledScene
from robocasa_lerobot.convert.scenes.demo_scene import DemoScene
from robocasa_lerobot.convert.scenes.prefetch import ScenesAhead, SceneSource
from robocasa_lerobot.convert.settings import Camera, ConversionSettings

SECONDS = 60
SETTINGS = ConversionSettings(image_size=32)
# Enough shelves for a look-alike.
SHELVES = SCENE.replace(
    '<body name="mobilebase0_base">',
    "".join(f'<geom type="box" size="0.1 0.3 0.01" pos="1.5 0 {z / 50}" group="1"/>' for z in range(80))
    + '<body name="mobilebase0_base">',
    1,
)


@pytest.fixture
def scenes() -> ScenesAhead:
    """Closed afterwards, and nothing of it left."""
    scenes, before = ScenesAhead(), _descriptors()
    yield scenes
    process = scenes._compiler and psutil.Process(scenes._compiler._process.pid)
    scenes.close()
    assert _descriptors() == before
    assert process is None or not psutil.pid_exists(process.pid)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A file with five demos, the first of them with a look-alike, the second damaged."""
    file = write_demos(tmp_path / "a.hdf5", (3, 4, 5, 3, 4))
    with h5py.File(file, "a") as written:
        written["data/demo_0"].attrs["model_file"] = SHELVES
        written["data/demo_1"].attrs["model_file"] = SCENE.replace('type="slide"', 'type="slippery"')
    return file


def _descriptors() -> int:
    return psutil.Process().num_fds()


def _scene(file: Path, number: int) -> DemoScene:
    return DemoScene(file, ROBOMIMIC, f"demo_{number}", ())


def _wait_for_start(scenes: ScenesAhead) -> None:
    deadline = time.monotonic() + SECONDS
    while not scenes._compiler.has_started():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def _requested(scenes: ScenesAhead, source: SceneSource, preset: str = "fast", pictures: bool = True) -> None:
    scenes.request(source, preset, pictures=pictures)
    _wait_for_start(scenes)


def _bytes(model: mujoco.MjModel) -> bytes:
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, content)
    return content.tobytes()


def _here(file: Path, number: int, preset: str) -> CompiledScene:
    with DemoFile(file) as opened:
        text = _scene(file, number).read(opened, opened.demo(f"demo_{number}"))
    return CompiledScene.of(*text, preset=preset)


@pytest.mark.render
@pytest.mark.parametrize("preset", ["fast", "quality"])
def test_a_scene_is_that_compiled_here(preset: str, source: Path, scenes: ScenesAhead) -> None:
    _requested(scenes, _scene(source, 0), preset)
    there, here = scenes.take(_scene(source, 0)), _here(source, 0, preset).with_merged_model()
    assert there is not None
    assert _bytes(there.model) == _bytes(here.model)
    assert (there.alike is None) == (here.alike is None) == (preset == "quality")
    if there.alike is not None and here.alike is not None:
        assert _bytes(there.alike.model) == _bytes(here.alike.model)
        np.testing.assert_array_equal(there.alike.bodies, here.alike.bodies)
        np.testing.assert_array_equal(there.alike.geoms, here.alike.geoms)
    cameras = [Camera(there.model.camera(i).name, 48, 64) for i in range(there.model.ncam)]
    with h5py.File(source) as file:
        state = file["data/demo_0/states"][2]
    drawn = []
    for compiled in (there, _here(source, 0, preset)):
        with Scene(compiled) as scene:
            scene.set_state(state)
            drawn.append(scene.pictures(cameras))
    for name, picture in drawn[0].items():
        np.testing.assert_array_equal(picture, drawn[1][name])


def test_without_pictures_no_merged_model_is_made(source: Path, scenes: ScenesAhead) -> None:
    _requested(scenes, _scene(source, 0), pictures=False)
    taken = scenes.take(_scene(source, 0))
    assert taken is not None
    assert taken.alike is None


def test_one_scene_after_the_other(source: Path, scenes: ScenesAhead) -> None:
    """Large and small ones, one that nobody takes, one that fails, and one that nobody asked for."""
    assert scenes.take(_scene(source, 0)) is None
    _requested(scenes, _scene(source, 0))
    assert scenes.take(_scene(source, 2)) is None
    assert scenes.take(_scene(source, 0)) is not None
    assert scenes.take(_scene(source, 0)) is None  # only once
    for number in (0, 1, 2):  # the first is never taken
        scenes.request(_scene(source, number), "fast", pictures=True)
        found = scenes.take(_scene(source, number)) if number else None
        assert (found is not None) == (number == 2)
    assert found is not None
    assert _bytes(found.model) == _bytes(_here(source, 2, "fast").model)
    scenes.close()
    _requested(scenes, _scene(source, 2))  # starts again
    assert scenes.take(_scene(source, 2)) is not None


def test_what_is_handed_over_is_let_go_of(source: Path, scenes: ScenesAhead) -> None:
    _requested(scenes, _scene(source, 0))
    assert scenes.take(_scene(source, 0)) is not None
    assert [os.fstat(file).st_size for file in scenes._compiler.files] == [0, 0]


@pytest.mark.parametrize("moment", ["before the request", "before it is taken"])
def test_a_process_that_dies_is_done_without(moment: str, source: Path, scenes: ScenesAhead) -> None:
    _requested(scenes, _scene(source, 2))
    process = psutil.Process(scenes._compiler._process.pid)
    if moment == "before the request":
        assert scenes.take(_scene(source, 2)) is not None
    process.kill()
    process.wait(SECONDS)
    if moment == "before the request":
        scenes.request(_scene(source, 0), "fast", pictures=True)
    assert scenes.take(_scene(source, 2 if moment == "before it is taken" else 0)) is None
    scenes.request(_scene(source, 2), "fast", pictures=True)
    assert scenes._compiler is None


def test_the_process_ends_with_the_one_that_started_it(source: Path) -> None:
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        scenes = ScenesAhead()
        scenes.request(_scene(source, 0), "fast", pictures=True)
        os.write(writing, str(scenes._compiler._process.pid).encode())
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    number = int(os.read(reading, 32))
    os.close(reading)
    os.close(writing)
    deadline = time.monotonic() + SECONDS
    while psutil.pid_exists(number) and psutil.Process(number).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def _convert(
    source: Path, out: Path, monkeypatch: pytest.MonkeyPatch, kill: bool
) -> tuple[ConversionResult, list[str]]:
    """A conversion that waits for the other process to start, or kills it, and which scenes that process made."""
    take, taken = ScenesAhead.take, []

    def waiting(scenes: ScenesAhead, wanted: DemoScene) -> CompiledScene | None:
        if scenes._compiler is not None:
            _wait_for_start(scenes)
            if kill:
                os.kill(scenes._compiler._process.pid, signal.SIGKILL)
                scenes._compiler._process.wait()
        found = take(scenes, wanted)
        taken.extend([wanted.demo] if found is not None else [])
        return found

    with monkeypatch.context() as patch:
        patch.setattr(ScenesAhead, "take", waiting)
        return convert([source], out, SETTINGS, workers=1), taken


def _content(out: Path) -> dict[str, str]:
    hashes = tree_hashes(out)
    del hashes[f"{META_FOLDER}/conversion.json"]  # names the output's place
    return hashes


@pytest.mark.costly
@pytest.mark.render
def test_a_dataset_does_not_depend_on_it(source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Over the borders of shards; the damaged one is rejected for the same reason, and nothing was asked for then."""
    monkeypatch.setattr(settings, "_MIN_SHARD_FRAMES", 4)
    before = psutil.Process().children()
    made, taken = _convert(source, tmp_path / "ahead", monkeypatch, kill=False)
    assert taken == ["demo_3", "demo_4"]
    killed, taken = _convert(source, tmp_path / "killed", monkeypatch, kill=True)
    assert taken == []
    monkeypatch.setattr(ScenesAhead, "request", lambda *_, **__: None)
    alone = convert([source], tmp_path / "alone", SETTINGS, workers=1)
    assert [line["source_demo"] for line in alone.rejected] == ["demo_1"]
    assert "slippery" in alone.rejected[0]["reason"]
    for name, result in (("ahead", made), ("killed", killed)):
        assert result.rejected == alone.rejected
        assert _content(tmp_path / name) == _content(tmp_path / "alone")
    assert psutil.Process().children() == before
