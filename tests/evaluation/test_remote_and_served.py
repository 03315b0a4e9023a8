"""Our clients ask our servers: the records of the same policy in process, whatever the protocol."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from serving_support import blocked_host, serving

from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.records.results import read_results
from robocasa_lerobot.evaluation.remote.client import Timeouts
from robocasa_lerobot.evaluation.remote.connect import connect
from robocasa_lerobot.evaluation.remote.failures import LostError
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.limits import Limits
from robocasa_lerobot.serving.policy import load_served


def evaluate(policy: str, out: Path, *more: str) -> list[dict[str, Any]]:
    fixed = ["--env.factory=evaluation_env:SlideEnv", "--env.tasks=Slide", "--trials=3", "--seed=1", "--videos=0"]
    arguments = ["eval", f"--policy={policy}", "--policy.label=same", f"--out={out}", "--report=false", *fixed, *more]
    assert main(arguments) == 0
    records = sorted(read_results(out).trials, key=lambda record: record.key)
    assert [record.error for record in records] == [None] * 3
    return [record.comparable() for record in records]


@pytest.fixture(scope="module")
def ours(checkpoint: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    return evaluate(str(checkpoint), tmp_path_factory.mktemp("ours"), "--workers=1")


@pytest.mark.parametrize("protocol", ["openpi", "vla_eval", "gr00t"])
def test_a_served_policy_takes_the_course_of_the_one_in_process(
    checkpoint: Path, tmp_path: Path, ours: list[dict[str, Any]], protocol: str
) -> None:
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), protocol) as port:
        theirs = evaluate(f"{protocol}://127.0.0.1:{port}", tmp_path / "theirs", "--workers=2")
    assert theirs == ours
    assert len({record["trajectory"] for record in ours}) == 3
    (header,) = read_results(tmp_path / "theirs").headers.values()
    info = header.policies["same"]
    assert info.remote is not None
    assert info.remote["keys"] == "ours"
    assert read_source(str(checkpoint)).fingerprint in info.remote["weights"]
    assert info.remote["outcomes"].startswith("fixed by the trial's seed")
    assert header.image_size == 32


def test_pictures_that_the_policy_was_not_trained_at_are_an_error(
    checkpoint: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), "openpi") as port:
        policy = f"--policy=openpi://127.0.0.1:{port}"
        arguments = ["--env.factory=evaluation_env:SlideEnv", "--env.tasks=Slide", f"--out={tmp_path / 'out'}"]
        assert main(["eval", policy, *arguments, "--env.image_size=48"]) == 2
    assert "found pictures of 48x48, expected 32x32" in capsys.readouterr().err


@pytest.mark.parametrize("protocol", ["openpi", "vla_eval"])
def test_a_client_too_many_waits_until_another_has_left(protocol: str) -> None:
    go = threading.Event()
    with serving(blocked_host(go, go), protocol, limits=Limits(clients=1)) as port:
        url = f"{protocol}://127.0.0.1:{port}"
        first = connect(url)
        with pytest.raises(LostError, match=r"1 clients are served already: give a larger --max-clients"):
            connect(url, Timeouts(connect=0.6))
        threading.Timer(0.5, first.close).start()
        second = connect(url, Timeouts(connect=30.0))
        assert second.metadata["policy"]["label"] == "blocked"
        second.close()
