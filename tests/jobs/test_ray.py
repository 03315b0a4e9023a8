"""What pieces ask Ray for, and which of them run: with a stand-in for Ray, which runs them in this process."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

import pytest
from ray_support import StandIn

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs import ray as ray_jobs
from robocasa_lerobot.jobs.executors import RaySettings, add_options, execution_of
from robocasa_lerobot.jobs.ray import run_with_ray


class Ran:
    """A step that counts."""

    def __init__(self) -> None:
        self.ranks: list[int] = []

    def __call__(self, data: Any, rank: int = 0, world_size: int = 1) -> None:
        self.ranks.append(rank)


def test_gpus_are_asked_for(ray: StandIn, tmp_path: Path) -> None:
    parser = argparse.ArgumentParser()
    add_options(parser)
    execution = execution_of(
        parser.parse_args(["--executor", "ray", "--ray.gpus", "2"], argparse.Namespace(workers=None))
    )
    with pytest.raises(UserError, match=r"it asks for 2 cores and 8 GiB and 2 GPU\(s\), found 4 cores and 64 GiB\."):
        run_with_ray(Ran(), 1, tmp_path, execution.ray)
    ray.resources["GPU"] = 2
    run_with_ray(Ran(), 1, tmp_path, execution.ray)
    assert ray.asked[-1]["num_gpus"] == 2


@pytest.mark.parametrize(("words", "at_a_time"), [(["--ray.jobs=2"], [2, 2, 2, 2, 1]), ([], [5, 4, 3, 2, 1])])
def test_no_more_pieces_run_at_a_time_than_were_asked_for(
    ray: StandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], at_a_time: list[int]
) -> None:
    parser = argparse.ArgumentParser()
    add_options(parser)
    found: list[int] = []
    wait = ray.wait

    def counted(references: Any, num_returns: int) -> Any:
        found.append(len(references))
        return wait(references, num_returns)

    monkeypatch.setattr(ray, "wait", counted)
    execution = execution_of(parser.parse_args(["--executor=ray", *words], argparse.Namespace(workers=None)))
    step = Ran()
    run_with_ray(step, 5, tmp_path, execution.ray)
    assert step.ranks == [0, 1, 2, 3, 4]
    assert found == at_a_time


def test_pieces_run_in_the_folder_of_the_command(ray: StandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found: list[Path] = []
    run_with_ray(lambda *_, **__: found.append(Path("relative").absolute()), 1, tmp_path, RaySettings())
    assert found == [tmp_path / "relative"]
    monkeypatch.setattr(Path, "cwd", lambda: tmp_path / "not there")
    with pytest.raises(UserError, match="give the command in a folder that all nodes share"):
        run_with_ray(Ran(), 1, tmp_path, RaySettings(), skip_complete=False)


def test_pieces_have_the_variables_of_the_command(
    ray: StandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the command was told by them counts on a cluster, too; a token is not among what Ray shows."""
    monkeypatch.setenv("ROBOCASA_LEROBOT_RENDERER", "egl")
    monkeypatch.setenv("ROBOCASA_LEROBOT_POLICY_TOKEN", "secret")
    found: list[str | None] = []

    def step(*_: Any, **__: Any) -> None:
        found.append(os.environ.get("ROBOCASA_LEROBOT_POLICY_TOKEN"))

    run = ray_jobs._run_piece

    def elsewhere(*args: Any) -> None:
        monkeypatch.delenv("ROBOCASA_LEROBOT_POLICY_TOKEN")
        run(*args)

    monkeypatch.setattr(ray_jobs, "_run_piece", elsewhere)
    run_with_ray(step, 1, tmp_path, RaySettings())
    told = ray.asked[-1]["runtime_env"]["env_vars"]
    assert told["ROBOCASA_LEROBOT_RENDERER"] == "egl"
    assert "ROBOCASA_LEROBOT_POLICY_TOKEN" not in told
    assert found == ["secret"]


def test_complete_pieces_run_again_where_the_step_knows_what_is_left(ray: StandIn, tmp_path: Path) -> None:
    step = Ran()
    for skip_complete in (True, True, False):
        run_with_ray(step, 2, tmp_path, RaySettings(), skip_complete=skip_complete)
    assert step.ranks == [0, 1, 0, 1]
