"""Vector envs: the same episodes as single envs, no final observation lost, and every failure of a worker reported."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import time
import types
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import vector_support
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode
from vector_support import FaultyEnv, two_workers

from robocasa_lerobot import contract, gl
from robocasa_lerobot.envs import vector_env
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.vector import WorkerError, env_info, make_vector_env
from robocasa_lerobot.errors import UnknownNameError, UserError

STILL = np.zeros((2, 2), np.float32)


@pytest.fixture(autouse=True)
def _no_backend_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Most of these envs do not render; and whatever happens, no worker outlives its test."""
    monkeypatch.setenv(gl.VARIABLE, os.environ.get(gl.VARIABLE) or "egl")
    monkeypatch.delenv(gl.DEVICE_VARIABLE, raising=False)
    before = set(multiprocessing.active_children())
    yield
    gc.collect()
    left = set(multiprocessing.active_children()) - before
    for process in left:
        process.kill()
    assert not left


def same(left: Any, right: Any) -> bool:
    """Whether two observations, infos or states are equal to the last bit and type."""
    if isinstance(left, dict):
        return left.keys() == right.keys() and all(same(left[key], right[key]) for key in left)
    if isinstance(left, np.ndarray):
        return left.dtype == right.dtype and left.shape == right.shape and left.tobytes() == right.tobytes()
    return type(left) is type(right) and left == right


def of_env(batch: Any, index: int) -> Any:
    """One env's observation out of a batch."""
    return {key: of_env(value, index) for key, value in batch.items()} if isinstance(batch, dict) else batch[index]


# ---- the same episodes as single envs ----


@pytest.mark.render
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_two_kitchens_go_the_way_of_two_single_envs(mode: AutoresetMode) -> None:
    """Pixels, proprioception, infos and full physics states, bit by bit, through two automatic resets."""
    tasks, seeds, horizon = ["OpenDrawer", "CloseDrawer"], [5, 11], 2
    kitchen: dict[str, Any] = {"image_size": 32, "horizon": horizon}
    singles = [KitchenEnv(task, **kitchen) for task in tasks]
    generator = np.random.default_rng(0)
    ends = 0
    with closing(make_vector_env(tasks, autoreset=mode, **kitchen)) as envs:
        observations, infos = envs.reset(seed=seeds)
        expected = [env.reset(seed=seed) for env, seed in zip(singles, seeds, strict=True)]
        ended = [False, False]
        for step in range(7 if mode == AutoresetMode.NEXT_STEP else 5):
            for index, (observation, info) in enumerate(expected):
                assert same(of_env(observations, index), observation), (step, index)
                assert same(env_info(infos, index), info), (step, index)
            for index, state in enumerate(envs.call("get_state")):
                assert pickle.dumps(state) == pickle.dumps(singles[index].get_state()), (step, index)
            actions = generator.uniform(-1, 1, (2, contract.ACTION_SIZE)).astype(np.float32)
            observations, _, terminated, truncated, infos = envs.step(actions)
            for index, env in enumerate(singles):
                if ended[index] and mode == AutoresetMode.NEXT_STEP:
                    expected[index], ended[index] = env.reset(), False
                    assert not terminated[index]
                    assert not truncated[index]
                    continue
                observation, _, term, trunc, info = env.step(actions[index])
                assert (terminated[index], truncated[index]) == (term, trunc)
                ended[index] = term or trunc
                if ended[index]:
                    ends += 1
                if ended[index] and mode == AutoresetMode.SAME_STEP:
                    assert same(infos["final_obs"][index], observation)
                    final = env_info(infos, index)
                    assert same(final["final_info"], info)
                    observation, info = env.reset()
                    info = {"final_obs": final["final_obs"], "final_info": final["final_info"], **info}
                expected[index] = observation, info
        assert envs.renderer is not None
        assert len(set(envs.renderers)) == 1
    assert ends >= 4
    for env in singles:
        env.close()


@pytest.mark.render
def test_the_seed_that_a_reset_will_draw_is_known_before() -> None:
    with closing(KitchenEnv("OpenDrawer", cameras=())) as env:
        env.reset(seed=3)
        foretold = [env.next_seed(), env.next_seed()]
        drawn = [env.reset()[1]["seed"] for _ in range(2)]
    assert foretold == [drawn[0], drawn[0]]
    assert drawn[0] != drawn[1]


# ---- automatic resets hide nothing ----


def test_next_step_gives_the_final_observation_as_the_steps_own() -> None:
    with closing(make_vector_env([FaultyEnv, partial(FaultyEnv, length=4)])) as envs:
        assert envs.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
        envs.reset(seed=7)
        for _ in range(3):
            observations, rewards, terminated, _, infos = envs.step(STILL)
        assert terminated.tolist() == infos["success"].tolist() == [True, False]
        assert rewards.tolist() == [1.0, 0.0]
        assert observations["agent_pos"].tolist() == [[7, 3], [8, 3]]
        observations, rewards, terminated, _, infos = envs.step(STILL)
        assert terminated.tolist() == [False, True]
        assert rewards.tolist() == [0.0, 1.0]
        assert observations["agent_pos"][0].tolist() == [infos["seed"][0], 0]
        assert observations["agent_pos"][1].tolist() == [8, 4]
        assert infos["seed"][0] not in (7, 8)


def test_same_step_keeps_the_final_observation_and_info_in_the_infos() -> None:
    with closing(make_vector_env([FaultyEnv, partial(FaultyEnv, length=4)], autoreset="same_step")) as envs:
        envs.reset(seed=7)
        for _ in range(3):
            observations, _, terminated, _, infos = envs.step(STILL)
        assert terminated.tolist() == [True, False]
        assert infos["success"].tolist() == [False, False]
        assert infos["_final_info"].tolist() == infos["_final_obs"].tolist() == [True, False]
        assert infos["final_obs"][0]["agent_pos"].tolist() == [7, 3]
        assert env_info(infos, 0)["final_info"] == {
            "success": True,
            "success_terms": {"Count done": True},
            "instruction": "Count Count",
            "seed": 7,
        }
        assert observations["agent_pos"][0].tolist() == [infos["seed"][0], 0]
        assert "final_info" not in env_info(infos, 1)


def test_without_autoreset_the_caller_resets_and_cannot_forget_to() -> None:
    with closing(make_vector_env([FaultyEnv, partial(FaultyEnv, length=4)], autoreset="disabled")) as envs:
        envs.reset(seed=7)
        for _ in range(3):
            envs.step(STILL)
        with pytest.raises(UserError, match=r"envs \[0\]: their episodes have ended"):
            envs.step(STILL)
        options = {"reset_mask": np.array([True, False])}
        observations, infos = envs.reset(seed=[30, None], options=options)
        assert observations["agent_pos"].tolist() == [[30, 0], [8, 3]]
        assert infos["_seed"].tolist() == [True, False]
        assert set(options) == {"reset_mask"}
        assert envs.step(STILL)[0]["agent_pos"].tolist() == [[30, 1], [8, 4]]


def test_infos_of_different_tasks_stay_apart() -> None:
    with closing(make_vector_env([partial(FaultyEnv, "A"), partial(FaultyEnv, "B")], 3)) as envs:
        _, infos = envs.reset(seed=[4, 5, 6])
        assert infos["success"].dtype == bool
        assert infos["seed"].tolist() == [4, 5, 6]
        assert infos["instruction"].tolist() == ["Count A", "Count B", "Count A"]
        assert infos["success_terms"]["_A done"].tolist() == [True, False, True]
        assert env_info(infos, 1)["success_terms"] == {"B done": False}


# ---- seeds ----


def test_every_env_gets_its_own_seed_and_wrong_ones_end_nothing() -> None:
    with closing(make_vector_env(FaultyEnv, 2)) as envs:
        for seed in (-1, 2**63, [1], [1, 2, 3], [1, "2"], [1, 2.5], [1, -2]):
            with pytest.raises(UserError, match="seed"):
                envs.reset(seed=seed)
        right: list[tuple[Any, list[int]]] = [
            (5, [5, 6]), (np.int64(5), [5, 6]), ([9, 2], [9, 2]), (np.array([3, 3]), [3, 3]), ([2**40, 1], [2**40, 1])
        ]  # fmt: skip
        for seed, expected in right:
            observations, _ = envs.reset(seed=seed)
            assert observations["agent_pos"][:, 0].tolist() == expected


# ---- failures ----

IN_STEP = ("step", 21, 2)
NEXT_SEED = int(np.random.default_rng(21).integers(1000))
FAULTS: dict[str, tuple[tuple[str, int | None, int], str, str]] = {
    "raise@make": (("start-up", None, 0), "ArithmeticError: it does not add up", "_maybe_fail"),
    "raise@step": (IN_STEP, "ArithmeticError: it does not add up", "_maybe_fail"),
    "raise@reset": (("autoreset", NEXT_SEED, 0), "ArithmeticError: it does not add up", "_maybe_fail"),
    "kill@make": (("start-up", None, 0), "SIGKILL", ""),
    "kill@step": (IN_STEP, "SIGKILL, perhaps for want of memory", ""),
    "kill@reset": (("autoreset", NEXT_SEED, 0), "SIGKILL", ""),
    "kill@call": (("call", 21, 0), "SIGKILL", ""),
    "exit@step": (IN_STEP, "exit status 7", ""),
    "crash@step": (IN_STEP, "SIGSEGV", "string_at"),
    "hang@step": (IN_STEP, "gave no answer for 2 s", "hang_here"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_workers_failure_is_reported_and_the_others_end(fault: str) -> None:
    progress, message, traceback = FAULTS[fault]
    made: list[Any] = []

    def use() -> None:
        made.append(make_vector_env(two_workers(fault), timeout_seconds=2 if fault.startswith("hang") else 60))
        made[0].reset(seed=20)
        if fault.endswith("call"):
            made[0].call("misbehave")
        for _ in range(6):
            made[0].step(STILL)

    with pytest.raises(WorkerError) as caught:
        use()
    error = caught.value
    assert error.index == 1
    assert (error.progress.phase, error.progress.seed, error.progress.steps) == progress
    assert message in str(error)
    assert traceback in error.worker_traceback
    assert error.worker_traceback in str(error)
    assert isinstance(error.__cause__, ArithmeticError) == fault.startswith("raise")
    assert bool(made) != fault.endswith("make")
    for envs in made:
        assert error.task == "Faulty"
        assert envs.closed
        assert envs.processes[0].exitcode == 0  # ended by itself
        assert not envs.processes[1].is_alive()
        with pytest.raises(ClosedEnvironmentError):
            envs.reset(seed=1)
        envs.close()
    assert pickle.loads(pickle.dumps(error)).progress == error.progress


@pytest.mark.parametrize("when", ["idle", "busy"])
def test_a_worker_that_is_killed_from_outside(when: str) -> None:
    with closing(make_vector_env(two_workers("hang@step"))) as envs:
        envs.reset(seed=20)
        envs.step(STILL)
        if when == "busy":
            envs.step_async(STILL)
            time.sleep(0.1)
        os.kill(envs.processes[1].pid, signal.SIGKILL)
        started = time.monotonic()
        with pytest.raises(WorkerError, match="SIGKILL") as caught:
            envs.step_wait() if when == "busy" else envs.step(STILL)
        assert time.monotonic() - started < 60  # not the 300 s after which it would count as hanging
        assert (caught.value.index, caught.value.progress.seed) == (1, 21)


def test_a_death_is_seen_while_another_worker_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vector_env, "CLOSE_SECONDS", 0.5)
    envs = make_vector_env([partial(FaultyEnv, fault="hang@step"), partial(FaultyEnv, "Dead", fault="kill@step")])
    envs.reset(seed=1)
    envs.step(STILL)
    with pytest.raises(WorkerError, match="task Dead"):
        envs.step(STILL)
    assert [process.exitcode for process in envs.processes] == [-signal.SIGKILL, -signal.SIGKILL]


def test_an_exception_in_a_call_ends_nothing() -> None:
    with closing(make_vector_env(two_workers("raise@call"))) as envs:
        envs.reset(seed=20)
        with pytest.raises(ArithmeticError) as caught:
            envs.call("misbehave")
        assert "env worker 1" in caught.value.__notes__[0]
        with pytest.raises(AttributeError):
            envs.get_attr("no_such_thing")
        assert envs.step(STILL)[0]["agent_pos"].tolist() == [[20, 1], [21, 1]]


def test_workers_end_when_their_parent_is_killed() -> None:
    parent = subprocess.Popen([sys.executable, vector_support.__file__], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    workers = [int(pid) for pid in parent.stdout.readline().split()]
    assert len(workers) == 2
    time.sleep(0.3)  # one idle, one busy
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 30
    while any(map(is_running, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_running, workers))


def is_running(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_opening_and_closing_leaves_nothing_behind() -> None:
    def use() -> tuple[int, int, int]:
        with closing(make_vector_env(FaultyEnv, 2)) as envs:
            envs.reset(seed=1)
            envs.step_async(STILL)  # closing does not wait for an answer that nobody takes
        del envs
        gc.collect()
        shared = len(list(Path("/dev/shm").iterdir()))
        return len(list(Path("/proc/self/fd").iterdir())), shared, len(multiprocessing.active_children())

    first = use()  # starts the fork server
    assert [use() for _ in range(3)] == [first] * 3


# ---- devices ----


def devices(*names: str) -> tuple[gl.RenderDevice, ...]:
    return tuple(gl.RenderDevice(index, name, index, False) for index, name in enumerate(names))


def test_workers_are_dealt_out_to_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "render_devices", lambda: devices("H200", "H200"))
    with closing(make_vector_env(FaultyEnv, 3, devices=[1, 0])) as envs:
        assert envs.call("variable", gl.DEVICE_VARIABLE) == ("1", "0", "1")
        assert envs.call("variable", gl.VARIABLE) == ("egl",) * 3
    assert gl.DEVICE_VARIABLE not in os.environ  # of this process


def test_a_device_in_the_environment_reaches_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "render_devices", lambda: devices("H200", "H200"))
    monkeypatch.setenv(gl.DEVICE_VARIABLE, "1")
    with closing(make_vector_env(FaultyEnv, 2)) as envs:
        assert envs.call("variable", gl.DEVICE_VARIABLE) == ("1", "1")
    monkeypatch.setenv(gl.DEVICE_VARIABLE, "first")
    with pytest.raises(gl.RenderDeviceError, match="'first'"):
        make_vector_env(FaultyEnv, 2)


@pytest.mark.parametrize("device", [2, -1, True])
def test_unknown_devices_are_refused_with_those_there_are(monkeypatch: pytest.MonkeyPatch, device: int) -> None:
    monkeypatch.setattr(gl, "render_devices", lambda: devices("H200", "A40"))
    for make in (
        lambda: make_vector_env(FaultyEnv, 2, devices=[0, device]),
        lambda: KitchenEnv("OpenDrawer", render_device=device),
        lambda: gl.ensure_gl(device),
    ):
        with pytest.raises(gl.RenderDeviceError, match=r"0: H200 \(CUDA 0\), 1: A40 \(CUDA 1\)"):
            make()


def test_devices_need_egl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(gl.VARIABLE, "osmesa")
    with pytest.raises(gl.RenderDeviceError, match="only EGL"):
        make_vector_env(FaultyEnv, 2, devices=0)


def test_a_process_that_draws_cannot_change_its_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "render_devices", lambda: devices("H200", "H200"))
    monkeypatch.setitem(sys.modules, "mujoco.egl", types.SimpleNamespace(EGL_DISPLAY=object()))
    monkeypatch.setenv(gl.DEVICE_VARIABLE, "0")
    assert gl.ensure_gl(0) == "egl"
    with pytest.raises(gl.RenderDeviceError, match="draws on device 0 already"):
        gl.ensure_gl(1)


@pytest.mark.render
def test_every_device_of_this_machine_can_be_pinned() -> None:
    """Each device that EGL lists is accepted in a worker, and what draws is told."""
    if os.environ[gl.VARIABLE] != "egl":
        pytest.skip("only EGL has numbered devices")
    assert [device.index for device in gl.render_devices()] == list(range(len(gl.render_devices())))
    device = gl.render_devices()[0].index
    with closing(make_vector_env("OpenDrawer", 1, devices=device, image_size=16, cameras=contract.CAMERAS[:1])) as envs:
        assert envs.renderers == (None,)
        envs.reset(seed=1)
        assert envs.renderer
        assert envs.call("render")[0].shape == (16, 16, 3)


# ---- software rendering beside a GPU ----


def test_software_rendering_beside_a_gpu_is_announced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "_announced", set())
    monkeypatch.setattr(gl, "has_gpu", lambda: True)
    with closing(make_vector_env(partial(FaultyEnv, renderer="llvmpipe (LLVM 15)"), 2)) as envs:
        with pytest.warns(gl.SoftwareRenderingWarning, match="although this machine has a GPU") as caught:
            envs.reset(seed=1)
        envs.step(STILL)
        assert len(caught) == 1
        assert envs.renderers == ("llvmpipe (LLVM 15)",) * 2


@pytest.mark.parametrize(("renderer", "gpu"), [("llvmpipe (LLVM 15)", False), ("NVIDIA H200/PCIe/SSE2", True)])
@pytest.mark.filterwarnings("error")
def test_what_is_as_it_should_be_is_not_announced(monkeypatch: pytest.MonkeyPatch, renderer: str, gpu: bool) -> None:
    monkeypatch.setattr(gl, "_announced", set())
    monkeypatch.setattr(gl, "has_gpu", lambda: gpu)
    with closing(make_vector_env(partial(FaultyEnv, renderer=renderer), 2)) as envs:
        envs.reset(seed=1)
        assert envs.renderer == renderer


@pytest.mark.render
def test_a_single_env_announces_it_although_the_backend_was_set_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "_announced", set())
    monkeypatch.setattr(gl, "has_gpu", lambda: True)
    monkeypatch.setattr(gl, "is_software", lambda renderer: True)
    with closing(KitchenEnv("OpenDrawer", image_size=16, cameras=contract.CAMERAS[:1])) as env:
        with pytest.warns(gl.SoftwareRenderingWarning):
            env.reset(seed=1)
        assert gl.used_renderer()


# ---- making them ----


def test_spawned_workers_do_as_well() -> None:
    with closing(make_vector_env(FaultyEnv, 1, context="spawn")) as envs:
        assert envs.reset(seed=1)[0]["agent_pos"].tolist() == [[1, 0]]


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"task": "OpenDrawr"}, UnknownNameError),
        ({"task": "OpenDrawer", "num_envs": 0}, UserError),
        ({"task": ["OpenDrawer", "CloseDrawer"], "num_envs": 1}, UserError),
        ({"task": []}, UserError),
        ({"task": FaultyEnv, "image_size": 32}, UserError),
        ({"task": "OpenDrawer", "render_device": 0}, UserError),
        ({"task": "OpenDrawer", "split": "tarjet"}, UnknownNameError),
        ({"task": FaultyEnv, "context": "fork"}, UnknownNameError),
        ({"task": FaultyEnv, "autoreset": "same"}, UnknownNameError),
        ({"task": FaultyEnv, "devices": []}, UserError),
    ],
)
def test_mistakes_are_told_before_any_worker_starts(arguments: dict[str, Any], error: type[UserError]) -> None:
    with pytest.raises(error):
        make_vector_env(**arguments)


@pytest.mark.render
@pytest.mark.slow
def test_lerobots_vector_env_reports_deaths_and_starts_anew() -> None:
    from robocasa_lerobot.envs.lerobot_plugin import RobocasaKitchenEnvConfig

    config = RobocasaKitchenEnvConfig(task="OpenDrawer", image_size=16, episode_length=3, render_devices=[0])
    envs = config.create_envs(2)["OpenDrawer"][0]
    with closing(envs):
        first, _ = envs.reset(seed=[1, 2], options={"lerobot_new_rollout": True})
        os.kill(envs._env.processes[0].pid, signal.SIGKILL)
        with pytest.raises(WorkerError, match=r"env worker 0 \(task OpenDrawer\).*SIGKILL"):
            envs.step(np.zeros((2, contract.ACTION_SIZE), np.float32))
        again, _ = envs.reset(seed=[1, 2], options={"lerobot_new_rollout": True})
        assert np.array_equal(first["agent_pos"], again["agent_pos"])
