"""Our kitchens as a benchmark of vla-eval, without vla-eval: names, orders, seeds, and what is refused."""

from __future__ import annotations

import importlib
import importlib.util

import numpy as np
import pytest

from robocasa_lerobot import contract
from robocasa_lerobot.envs.tasks.registry import get_task, task_set
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.planning.trials import make_plan
from robocasa_lerobot.gl import ensure_gl
from robocasa_lerobot.serving.kitchens import TARGET_SETS, Kitchens
from robocasa_lerobot.serving.observations import Wanted, read_observation

SIZE = 32


def test_tasks_are_the_target_tasks_or_those_that_are_named() -> None:
    every = Kitchens().tasks()
    assert {task["suite"] for task in every} <= set(TARGET_SETS)
    assert [task["name"] for task in every if task["suite"] == "atomic_seen"] == list(task_set("atomic_seen"))
    other = next(task for task in task_set("lifelong_phase1") if task not in {one["name"] for one in every})
    some = Kitchens(["OpenDrawer", "lifelong_phase1"])
    names = [task["name"] for task in some.tasks()]
    assert names[0] == "OpenDrawer"
    assert set(names) == {"OpenDrawer", *task_set("lifelong_phase1")}
    assert {"name": other, "suite": "other"} in some.tasks()
    assert some.longest == max(get_task(name).horizon for name in names)
    assert Kitchens(["OpenDrawer"], max_steps=7).horizon("OpenDrawer") == 7


def test_seeds_are_those_of_an_evaluation() -> None:
    kitchens = Kitchens(["OpenDrawer"], seed=100_007)
    for spec in make_plan(["x"], {"OpenDrawer": None}, 3, 100_007, videos=0):
        assert kitchens.seeds("OpenDrawer", spec.trial) == {"seed": spec.seed, "policy_seed": spec.policy_seed}


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"tasks": "OpenDrawer"}, "a list of names"),
        ({"tasks": ["OpenDrwer"]}, "OpenDrawer"),
        ({"tasks": []}, "found none"),
        ({"seed": -1}, "at least 0"),
        ({"split": "targt"}, "Did you mean 'target'"),
        ({"render_preset": "nice"}, "fast, quality"),
        ({"camera_size": 0}, "camera_size: found 0"),
        ({"max_steps": 0}, "max_steps: found 0"),
    ],
)
def test_mistakes_are_told(settings: dict[str, object], text: str) -> None:
    with pytest.raises(UserError, match=text):
        Kitchens(**settings)  # type: ignore[arg-type]


def test_vla_eval_is_asked_for_only_with_its_class() -> None:
    module = importlib.import_module("robocasa_lerobot.serving.vla_eval_benchmark")
    if importlib.util.find_spec("vla_eval") is None:
        with pytest.raises(UserError, match=r"install vla-eval==0\.8\.0"):
            _ = module.KitchenBenchmark
    with pytest.raises(AttributeError, match="Kitchen"):
        _ = module.Kitchen


def test_what_holds_still_keeps_the_gripper() -> None:
    assert not Kitchens.held(None).any()
    gripper = contract.ACTION_SLICES_HDF5["gripper_close"]
    held = Kitchens.held(np.full(12, 0.7))
    assert held[gripper] == np.float32(0.7)
    assert np.count_nonzero(held) == 1


@pytest.mark.render
def test_a_trial_has_the_benchmarks_names_and_order() -> None:
    ensure_gl()
    kitchens = Kitchens(["OpenDrawer"], camera_size=SIZE, max_steps=3, seed=100_007)
    first = kitchens.reset("OpenDrawer", 0)
    # What our own servers understand, with the very state of the env.
    asked = read_observation(first, Wanted(contract.CAMERAS, (SIZE, SIZE), (0,)))
    assert asked.instruction == first["task_description"]
    assert not asked.stored_order
    assert [picture.shape for picture in first["images"].values()] == [(SIZE, SIZE, 3)] * 3
    for wrong in (np.zeros(11), np.full(12, np.nan), None, {"action": "x"}, np.zeros((2, 12))):
        with pytest.raises(UserError, match="12"):
            kitchens.step(wrong)
    # The gripper is the seventh number of an action in HDF5 order, and the last in ours: it closes.
    fingers = [first["state"]["state.gripper_qpos"]]
    for _ in range(3):
        step = kitchens.step({"actions": np.r_[np.zeros(6), 1.0, np.zeros(5)]})
        fingers.append(step.observation["state"]["state.gripper_qpos"])
    assert np.ptp(fingers[-1]) < np.ptp(fingers[0]) - 0.005
    assert (step.done, step.success) == (True, False)
    # The same trial again is the same.
    again = kitchens.reset("OpenDrawer", 0)
    for name, value in first["state"].items():
        np.testing.assert_array_equal(again["state"][name], value)
    assert kitchens.reset("OpenDrawer", 1)["state"]["state.base_position"].tolist() != value.tolist()
    kitchens.close()
