"""Vector envs: the same episodes as single envs, whatever the number of workers, and no final observation lost."""

from __future__ import annotations

import os
import pickle
import signal
from contextlib import closing
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from vector_support import STILL, FaultyEnv, clean_workers  # noqa: F401 (a fixture)

from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.vector import freeze_at_end as hold
from robocasa_lerobot.envs.vector.kitchens import KitchenVectorEnv, WorkerError, env_info, make_vector_env
from robocasa_lerobot.errors import UnknownNameError, UserError


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


@pytest.mark.costly
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


@pytest.mark.parametrize("shape", [(1, 2), (3, 2), (2, 3)])
def test_actions_of_another_shape_leave_no_env_ahead(shape: tuple[int, ...]) -> None:
    with closing(make_vector_env([FaultyEnv, FaultyEnv])) as envs:
        envs.reset(seed=7)
        with pytest.raises(UserError, match=r"found shape .*, expected \(2,"):
            envs.step(np.zeros(shape, np.float32))
        observations, *_ = envs.step(STILL)
        assert observations["agent_pos"][:, 1].tolist() == [1, 1]


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


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.DISABLED])
def test_a_state_that_is_set_after_the_end_goes_on(mode: AutoresetMode) -> None:
    kitchen: dict[str, Any] = {"cameras": (), "horizon": 2}
    action = np.zeros((1, contract.ACTION_SIZE), dtype=np.float32)
    with closing(make_vector_env(["OpenDrawer"], autoreset=mode, **kitchen)) as envs:
        envs.reset(seed=[5])
        (begin,) = envs.call("get_state")
        envs.step(action)
        (expected,) = envs.call("get_state")
        _, _, _, truncated, _ = envs.step(action)
        assert truncated.all()
        envs.call("set_state", begin)
        envs.step(action)
        (found,) = envs.call("get_state")
    assert pickle.dumps(found) == pickle.dumps(expected)


def test_a_state_that_is_set_ends_the_hold_of_an_ended_env() -> None:
    action = np.zeros(contract.ACTION_SIZE, dtype=np.float32)
    with closing(hold.HoldAtEnd(KitchenEnv("OpenDrawer", cameras=(), horizon=2))) as env:
        env.reset(seed=5)
        begin = env.unwrapped.get_state()
        expected = env.step(action)[0]["agent_pos"]
        assert env.step(action)[3]
        env.step(action)
        assert env.unwrapped.steps == 2
        env.get_wrapper_attr("set_state")(begin)
        assert env.unwrapped.steps == 0
        observation, *_, truncated, _ = env.step(action)
        assert not truncated
        assert np.array_equal(observation["agent_pos"], expected)


def test_infos_of_different_tasks_stay_apart() -> None:
    with closing(make_vector_env([partial(FaultyEnv, "A"), partial(FaultyEnv, "B")], 3)) as envs:
        _, infos = envs.reset(seed=[4, 5, 6])
        assert infos["success"].dtype == bool
        assert infos["seed"].tolist() == [4, 5, 6]
        assert infos["instruction"].tolist() == ["Count A", "Count B", "Count A"]
        assert infos["success_terms"]["_A done"].tolist() == [True, False, True]
        assert env_info(infos, 1)["success_terms"] == {"B done": False}


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


def test_gymnasiums_make_vec_makes_ours() -> None:
    with closing(gymnasium.make_vec("robocasa_lerobot/OpenDrawer", num_envs=2, cameras=(), horizon=5)) as envs:
        assert isinstance(envs, KitchenVectorEnv)
        assert envs.call("horizon") == (5, 5)


def test_gymnasiums_time_limit_is_told_to_be_the_horizon() -> None:
    with pytest.raises(UnknownNameError, match=r"'max_episode_steps'.*`horizon`"):
        gymnasium.make_vec("robocasa_lerobot/OpenDrawer", num_envs=2, max_episode_steps=100)


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
        ({"task": "OpenDrawer", "image_sz": 64}, UnknownNameError),
    ],
)
def test_mistakes_are_told_before_any_worker_starts(arguments: dict[str, Any], error: type[UserError]) -> None:
    with pytest.raises(error):
        make_vector_env(**arguments)


def test_holding_an_ended_env_does_what_lerobots_own_wrapper_does() -> None:
    from lerobot.envs.utils import NEW_ROLLOUT_OPTION, FreezeAfterEpisodeEnd

    assert hold.NEW_ROLLOUT == NEW_ROLLOUT_OPTION
    ours, theirs = hold.HoldAtEnd(FaultyEnv()), FreezeAfterEpisodeEnd(FaultyEnv())
    new = {NEW_ROLLOUT_OPTION: True}
    results = [
        [
            env.reset(seed=1, options=new),
            *[env.step(STILL[0]) for _ in range(5)],
            env.reset(),
            env.step(STILL[0]),
            env.reset(seed=2, options=new),
            env.step(STILL[0]),
            env.reset(seed=3),
        ]
        for env in (ours, theirs)
    ]
    for index, (our, their) in enumerate(zip(*results, strict=True)):
        assert all(same(a, b) for a, b in zip(our, their, strict=True)), index
    assert results[0][5][0]["agent_pos"].tolist() == [1, 3]  # the fifth step is still the third
    assert results[0][-1][0]["agent_pos"].tolist() == [3, 0]  # a reset in mid-episode is one
    for _ in range(5):
        ours.step(STILL[0])
    assert ours.reset(seed=4)[0]["agent_pos"].tolist() == [4, 0]  # a seed begins an episode, which LeRobot's does not


@pytest.mark.render
@pytest.mark.slow
def test_lerobots_vector_env_reports_deaths_and_starts_anew() -> None:
    from robocasa_lerobot.envs.lerobot_plugin import RobocasaKitchenEnvConfig

    config = RobocasaKitchenEnvConfig(task="OpenDrawer", image_size=16, episode_length=3)
    envs = config.create_envs(2)["OpenDrawer"][0]
    with closing(envs):
        first, _ = envs.reset(seed=[1, 2], options={"lerobot_new_rollout": True})
        os.kill(envs._env.processes[0].pid, signal.SIGKILL)
        with pytest.raises(WorkerError, match=r"env worker 0 \(task OpenDrawer\).*SIGKILL"):
            envs.step(np.zeros((2, contract.ACTION_SIZE), np.float32))
        again, _ = envs.reset(seed=[1, 2], options={"lerobot_new_rollout": True})
        assert np.array_equal(first["agent_pos"], again["agent_pos"])
