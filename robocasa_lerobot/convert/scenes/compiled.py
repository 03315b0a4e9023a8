"""A compiled scene: its MuJoCo model and, once made, the look-alike that draws faster; kept in files and read again."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.reading.hdf5 import RejectedEpisodeError
from robocasa_lerobot.envs.rendering.merged_model import VISIBLE_GROUPS, MergedModel, merged_model

PRESETS = ("fast", "quality")
_QUALITY_SAMPLES = 4  # multisampling of the `quality` preset

Files = tuple[int, int]  # file descriptors: for the model, and for the one of its look-alike


@dataclass(frozen=True)
class CompiledScene:
    """What a scene is drawn from.

    Attributes:
        model: with what the preset leaves out taken out.
        preset: `fast` (no shadows, reflections or multisampling) or `quality`.
        alike: the look-alike, or None where it has not been made or there is none.
    """

    model: mujoco.MjModel
    preset: str
    alike: MergedModel | None = None

    @classmethod
    def of(cls, xml: str, assets: Mapping[str, bytes], preset: str = "fast") -> Self:
        """Compile an MJCF whose files are in `assets` (file name -> bytes).

        Raises:
            RejectedEpisodeError: MuJoCo does not load the MJCF.
        """
        assert preset in PRESETS, preset
        try:
            model = mujoco.MjModel.from_xml_string(xml, dict(assets))
        except (ValueError, RuntimeError, mujoco.FatalError) as error:
            reason = " ".join(str(error).split())
            raise RejectedEpisodeError(
                f"its model_file does not load in MuJoCo {mujoco.__version__}: {reason}"
            ) from None
        model.vis.quality.offsamples = 0 if preset == "fast" else _QUALITY_SAMPLES
        if preset == "fast":
            model.light_castshadow[:] = 0
            model.mat_reflectance[:] = 0
        return cls(model, preset)

    def with_merged_model(self) -> Self:
        """The same with the look-alike that pictures will be drawn from, if the preset has one."""
        return self if self.preset != "fast" else replace(self, alike=merged_model(self.model, VISIBLE_GROUPS))


@dataclass(frozen=True)
class KeptScene:
    """The record of a scene, kept beside its models: where the geoms of its look-alike come from, if it has one."""

    preset: str
    bodies: NDArray[np.intp] | None = None
    geoms: NDArray[np.intp] | None = None


def keep(scene: CompiledScene, files: Files) -> KeptScene:
    """Write the models of a scene into files, in place of what was in them.

    Raises:
        OSError: there is no room, or files may not grow.
    """
    _write(scene.model, files[0])
    if scene.alike is None:
        return KeptScene(scene.preset)
    assert not scene.alike.loose, "it has just been made"
    _write(scene.alike.model, files[1])
    return KeptScene(scene.preset, scene.alike.bodies, scene.alike.geoms)


def kept(scene: KeptScene, files: Files) -> CompiledScene:
    """A scene out of the files in which it is kept, which are empty afterwards.

    Raises:
        OSError, ValueError: they cannot be read.
    """
    model = _read(files[0])
    if scene.bodies is None or scene.geoms is None:
        return CompiledScene(model, scene.preset)
    alike = MergedModel(model, _read(files[1]), scene.bodies, scene.geoms, frozenset())
    return CompiledScene(model, scene.preset, alike)


def _write(model: mujoco.MjModel, file: int) -> None:
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, content)
    with open(file, "wb", closefd=False) as stream:
        os.ftruncate(file, 0)
        stream.seek(0)
        stream.write(content)


def _read(file: int) -> mujoco.MjModel:
    os.lseek(file, 0, os.SEEK_SET)
    # By the descriptor's path: from bytes in memory MuJoCo makes copies, and takes five times as long.
    model = mujoco.MjModel.from_binary_path(f"/dev/fd/{file}")
    os.ftruncate(file, 0)
    return model
