"""Demonstrations of another simulator as sources: files of robosuite or robomimic with a Panda on a stand."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import h5py
import mujoco

from robocasa_lerobot.convert.reading.mjcf import AssetFinder, loadable
from robocasa_lerobot.demos.generate.fixed_arm.prepare import datagen_of
from robocasa_lerobot.demos.generate.mimicgen.subtasks import DatagenInfo, write_datagen
from robocasa_lerobot.demos.generate.sources.prepared import GROUP
from robocasa_lerobot.demos.replay import demonstrations
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.hdf5_files import changed_hdf5

ACTIONS = 7  # `OSC_POSE` deltas and the fingers


def prepare_foreign(path: Path, bodies: Sequence[str], asset_roots: Sequence[Path] = ()) -> Iterator[DatagenInfo]:
    """Write `datagen_info` beside every demonstration of a file, which is replaced when all are ready.

    Args:
        path: an HDF5 file with `states`, `actions` and `model_file` of each.
        bodies: of the objects that subtasks are relative to; the signal `grasp` is about the first.
        asset_roots: folders with the meshes that the models name.

    Raises:
        UserError: it is no such file, or its actions are no deltas of `OSC_POSE`.
        UnknownNameError: a model has no such body.
    """
    found = []
    for number, (_, demo) in enumerate(demonstrations([path])):
        with h5py.File(path) as file:
            _check_controller(file["data"], path)
            group = file[f"data/{demo}"]
            states, actions = group["states"][()], group["actions"][()]
        if actions.shape[1] != ACTIONS:
            raise UserError(
                f"{path}, {demo}: {actions.shape[1]} numbers in an action, expected {ACTIONS}: a Panda on a stand with "
                "OSC_POSE. Files of these kitchens are prepared without --bodies."
            )
        model = model_of(path, demo, asset_roots)
        try:
            info = datagen_of(number, f"{path.stem}/{demo}", model, states, actions, bodies)
        except KeyError as error:
            raise UserError(
                f"{path}, {demo}: its model has no Panda with a Panda's gripper under robosuite's names ({error}). "
                "Sources of other robots cannot be carried over."
            ) from error
        found.append((demo, info))
        yield found[-1][1]
    with changed_hdf5(path) as file:
        for demo, info in found:
            group = file[f"data/{demo}"]
            if GROUP in group:
                del group[GROUP]
            write_datagen(group.create_group(GROUP), info, _env_name(file["data"]))


def model_of(path: Path, demo: str, asset_roots: Sequence[Path] = ()) -> mujoco.MjModel:
    """The model in which a demonstration was recorded.

    Raises:
        UserError: it has none, its meshes are nowhere, or MuJoCo does not load it.
    """
    with h5py.File(path) as file:
        xml = file[f"data/{demo}"].attrs.get("model_file")
    if xml is None:
        raise UserError(f"{path}, {demo}: it has no model_file.")
    text, assets = loadable(str(xml), AssetFinder(asset_roots))
    try:
        return mujoco.MjModel.from_xml_string(text, assets)
    except ValueError as error:
        raise UserError(f"{path}, {demo}: MuJoCo {mujoco.__version__} does not load its model ({error}).") from error


def _about(data: h5py.Group) -> dict[str, Any]:
    if "env_args" in data.attrs:
        known: dict[str, Any] = json.loads(data.attrs["env_args"]).get("env_kwargs", {})
        return known
    found: dict[str, Any] = json.loads(data.attrs.get("env_info", "{}"))
    return found


def _env_name(data: h5py.Group) -> str:
    return str(data.attrs.get("env", "") or json.loads(data.attrs.get("env_args", "{}")).get("env_name", ""))


def _check_controller(data: h5py.Group, path: Path) -> None:
    configured = _about(data).get("controller_configs", {})
    kind, delta = configured.get("type"), configured.get("control_delta", True)
    if kind != "OSC_POSE" or not delta:
        raise UserError(
            f"{path}: its controller is {kind} {'with' if delta else 'without'} deltas, expected OSC_POSE with deltas: "
            "the poses that actions lead to are told from it."
        )
