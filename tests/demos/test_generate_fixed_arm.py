"""Sources of other simulators: robosuite's human Lift demonstrations multiply in their own scene."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import mujoco
import numpy as np
import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.demos.generate.fixed_arm.attempt import ArmScene, generate
from robocasa_lerobot.demos.generate.mimicgen.subtasks import DatagenInfo, read_datagen
from robocasa_lerobot.demos.generate.mimicgen.template import Template, template_from
from robocasa_lerobot.demos.generate.sources.prepared import GROUP
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.making.foreign_sources import model_of

CUBE, TABLE_M, LIFTED_M = "cube_main", 0.8, 0.04
SPREAD_M = 0.03  # of robosuite's own placement, along x and y; any heading
TEMPLATE: dict[str, Any] = {
    "task": {
        "task_spec": {
            "subtask_1": {
                "object_ref": CUBE,
                "subtask_term_signal": "grasp",
                "subtask_term_offset_range": [5, 10],
                "selection_strategy": "nearest_neighbor_object",
            },
            "subtask_2": {"object_ref": CUBE},
        }
    }
}


def lifted(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """robosuite's own check: the cube's middle is 4 cm over the table."""
    return bool(data.body(CUBE).xpos[2] > TABLE_M + LIFTED_M)


@pytest.fixture(scope="module")
def lift(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[list[ArmScene], list[DatagenInfo], Template]:
    path = tmp_path_factory.mktemp("lift") / "lift.hdf5"
    shutil.copy(shared / "real" / "robosuite_lift" / "demo.hdf5", path)
    path.chmod(0o644)
    assets = shared / "real" / "robosuite_lift" / "assets"
    assert cli.main(["prepare", str(path), "--bodies", CUBE, "--asset-root", str(assets)]) == 0
    scenes, infos = [], []
    with h5py.File(path) as file:
        for number, (demo, group) in enumerate(file["data"].items()):
            infos.append(read_datagen(number, demo, group[GROUP]))
            scenes.append(ArmScene(model_of(path, demo, [assets]), group["states"][0], lifted))
    return scenes, infos, template_from(TEMPLATE)


def moved(rng: np.random.Generator) -> Any:
    """Puts the cube where robosuite might, with any heading."""

    def put(model: mujoco.MjModel, state: Array) -> Array:
        at = 1 + int(model.jnt_qposadr[model.body(CUBE).jntadr[0]])
        yaw = rng.uniform(0.0, 2.0 * np.pi)
        state[at : at + 2] = rng.uniform(-SPREAD_M, SPREAD_M, 2)
        state[at + 3 : at + 7] = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]
        return state

    return put


def test_a_file_of_robosuite_is_prepared(lift: tuple[list[ArmScene], list[DatagenInfo], Template]) -> None:
    _, infos, _ = lift
    for info in infos:
        steps = len(info.eef)
        assert info.target.shape == info.objects[CUBE].shape == (steps, 4, 4)
        ahead = np.linalg.norm(info.target[:, :3, 3] - info.eef[:, :3, 3], axis=1)
        assert 0.02 < ahead.max() < 0.05 * np.sqrt(3) + 1e-9
        grasp = int(info.signals["grasp"].argmax())
        assert 0 < grasp < steps
        near = np.linalg.norm(info.eef[grasp, :3, 3] - info.objects[CUBE][grasp, :3, 3])
        assert near < 0.03
        assert info.gripper[grasp] > 0


@pytest.mark.costly
def test_a_source_succeeds_in_its_own_scene(lift: tuple[list[ArmScene], list[DatagenInfo], Template]) -> None:
    scenes, infos, template = lift
    for scene, info in zip(scenes, infos, strict=True):
        assert generate(scene, scene.begin(), [info], template, np.random.default_rng(0)).success


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_three_human_demonstrations_multiply(lift: tuple[list[ArmScene], list[DatagenInfo], Template]) -> None:
    scenes, infos, template = lift
    kept = 0
    for seed in range(50):
        rng, scene = np.random.default_rng(seed), scenes[seed % len(scenes)]
        made = generate(scene, scene.begin(moved(rng)), infos, template, rng)
        kept += made.success
        assert made.ever or not made.success
    print(f"{kept} of 50")
    assert kept >= 20


def test_what_cannot_be_prepared(shared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "lift.hdf5"
    shutil.copy(shared / "real" / "robosuite_lift" / "demo.hdf5", path)
    path.chmod(0o644)
    before = path.read_bytes()
    command = ["prepare", str(path), "--asset-root", str(shared / "real" / "robosuite_lift" / "assets"), "--bodies"]
    assert cli.main([*command, "cube_man"]) == 2
    assert "cube_main" in capsys.readouterr().err
    assert path.read_bytes() == before
    with h5py.File(path, "r+") as file:
        info = json.loads(file["data"].attrs["env_info"])
        info["controller_configs"]["type"] = "JOINT_POSITION"
        file["data"].attrs["env_info"] = json.dumps(info)
    assert cli.main([*command, CUBE]) == 2
    assert "OSC_POSE" in capsys.readouterr().err
