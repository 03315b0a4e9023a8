"""Envs of other interpreters: the same trials as in this one, resumed after a kill, and faults that have a cause."""

from __future__ import annotations

import ast
import csv
import dataclasses
import io
import os
import pickle
import re
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trial_faults
from tiny_checkpoint import SIZE
from trial_faults import assert_faults_cost_only_their_trials

from robocasa_lerobot.cli import main
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.planning.trials import trial_seed
from robocasa_lerobot.evaluation.records.results import TRIALS_FILE, TrialRecord, read_results
from robocasa_lerobot.evaluation.run import engine
from robocasa_lerobot.evaluation.simulators import foreign_worker
from robocasa_lerobot.evaluation.simulators.fit import UnfitPolicyError
from robocasa_lerobot.evaluation.simulators.foreign_env import ForeignEnv
from robocasa_lerobot.evaluation.simulators.process import EnvRaisedError, ForeignProcess, SimulatorError
from robocasa_lerobot.evaluation.simulators.simulator import Simulator
from robocasa_lerobot.video import frames_and_rate

ROOT = Path(__file__).parents[2]
SUPPORT = ROOT / "tests" / "support"
PLAIN = f"{SUPPORT / 'foreign_envs.py'}:PlainEnv"
SLIDE = f"{SUPPORT / 'evaluation_env.py'}:SlideEnv"


def arguments(out: Path, **changes: Any) -> list[str]:
    values = {
        "env.python": sys.executable,
        "env.factory": PLAIN,
        "env.tasks": "Slide,Push",
        "policy": "random,zero,demonstrator",
        "trials": 3,
        "videos": 0,
        "workers": 1,
        "report": "false",
        **changes,
    }
    return [f"--out={out}", *(f"--{name}={value}" for name, value in values.items() if value is not None)]


def evaluate(out: Path, **changes: Any) -> list[TrialRecord]:
    return engine.evaluate(engine.prepare(load_config(EvaluationConfig, arguments(out, **changes))))


def comparable(records: list[TrialRecord]) -> list[dict[str, Any]]:
    return [record.comparable() for record in sorted(records, key=lambda record: record.key)]


def test_an_env_with_nothing_but_numpy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["eval", *arguments(out, videos=1, report="true")]) == 0
    results = read_results(out)
    (header,) = results.headers.values()
    assert header.split == "own"
    assert header.settings["simulator"]["versions"]["numpy"] == np.__version__
    by_policy = {label: [r for r in results.trials if r.label == label] for label in header.policies}
    assert [(r.success, r.error) for r in by_policy["demonstrator"]] == [(True, None)] * 6
    assert not any(r.success for r in by_policy["zero"])
    assert {r.steps for r in by_policy["zero"]} == {20}
    assert len({r.trajectory for r in by_policy["random"]}) == 6
    assert {r.instruction for r in results.trials} == {"slide it", "push it"}
    steps = [r.steps for r in by_policy["demonstrator"] if r.task == "Slide"]
    with (out / "report.csv").open() as file:
        rows = {(row["policy"], row["task"]): row["median_seconds_to_success"] for row in csv.DictReader(file)}
    assert float(rows["demonstrator", "Slide"]) == pytest.approx(np.median(steps) / 7)  # its own 7 Hz
    films = [out / r.video for r in by_policy["zero"] if r.video]
    assert [frames_and_rate(film) for film in films] == [(11, 4.0)] * 2  # half of its own 7 Hz, rounded
    assert "another simulator's own scenes" in (out / "report.md").read_text()
    # Another adapter behind the same settings is another evaluation.
    with pytest.raises(UserError, match=r"factory: .* in the file"):
        evaluate(out, **{"env.factory": f"{SUPPORT / 'foreign_envs.py'}:WithoutExpert", "policy": "zero"})


def test_the_same_env_here_and_in_another_process_gives_the_same_trials(tmp_path: Path, checkpoint: Path) -> None:
    own = {"policy": checkpoint, "policy.label": "tiny", "env.image_size": SIZE, "trials": 4, "env.horizon": 17}
    there = evaluate(tmp_path / "there", **own, **{"env.factory": SLIDE}, workers=2)
    here = evaluate(tmp_path / "here", **own, **{"env.factory": "evaluation_env:SlideEnv", "env.python": None})
    for one, other in zip(comparable(there), comparable(here), strict=True):
        scene = ("split", "layout_id", "style_id")
        assert {k: v for k, v in one.items() if k not in scene} == {k: v for k, v in other.items() if k not in scene}
        assert one["error"] is None
    assert len({record.trajectory for record in here}) == 8


def test_a_wrapper_hides_nothing_that_an_env_says(tmp_path: Path) -> None:
    own = {"policy": "zero,demonstrator", "env.tasks": "Push", "trials": 2}
    found = {}
    for name in ("ExpertSlide", "wrapped"):
        factory = f"{SUPPORT / 'evaluation_env.py'}:{name}"
        found[name] = comparable(evaluate(tmp_path / name, **own, **{"env.factory": factory}))
        asked = foreign_worker.Host()
        asked.make(factory, "Push", {})
        pictures = [
            asked.reset(seed=0, pictures=shown)[1].get("pixels/robot0_agentview_left") for shown in (True, False)
        ]
        assert pictures[0] is not None
        assert pictures[1] is None
    assert found["ExpertSlide"] == found["wrapped"]
    assert {trial["instruction"] for trial in found["wrapped"]} == {"push the block"}
    assert {trial["steps"] for trial in found["wrapped"] if trial["label"] == "zero"} == {30}
    assert all(trial["success"] for trial in found["wrapped"] if trial["label"] == "demonstrator")


def test_check_says_where_trials_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["eval", "--check", *arguments(tmp_path)]) == 0
    assert "2 tasks, 18 trials in another simulator" in capsys.readouterr().out


def test_fixed_starts_are_the_seeds(tmp_path: Path) -> None:
    own = {"policy": "zero", "env.options.fixed": "true"}
    records = evaluate(tmp_path / "a", **own)
    assert [r.seed for r in records if r.task == "Slide"] == [0, 1, 2]
    assert [r.seed for r in records if r.task == "Push"] == [trial_seed(0, "Push", trial) for trial in range(3)]
    with pytest.raises(UserError, match="task Slide has 3 fixed starts, 4 trials"):
        evaluate(tmp_path / "b", **own, trials=4)


@pytest.mark.slow
def test_killed_and_given_again(tmp_path: Path) -> None:
    notes = tmp_path / "pids"
    notes.mkdir()
    own = {"env.options.note": notes, "trials": 6, "workers": 2, "policy": "random,zero"}
    whole = evaluate(tmp_path / "whole", **own)
    out = tmp_path / "out"
    command = [sys.executable, str(ROOT / "eval.py"), *arguments(out, **own)]
    path = out / TRIALS_FILE
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while (path.read_bytes().count(b"\n") if path.exists() else 0) < 4:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait()
    while any(_alive(int(note.name)) for note in notes.iterdir()):  # no simulator outlives its evaluation
        assert time.monotonic() < deadline
        time.sleep(0.05)
    recorded = path.read_bytes().count(b"\n")
    assert recorded < 25, "it was not killed in the middle"
    subprocess.run(command, capture_output=True, timeout=300, check=True)
    assert path.read_bytes().count(b"\n") == 25, "a recorded trial ran again, or one is missing"
    assert comparable(read_results(out).trials) == comparable(whole)


def _alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


REASONS = {**trial_faults.REASONS, "sigkill": ("crashed", "the simulator's process was ended by SIGKILL")}


@pytest.mark.costly
def test_faulty_trials_cost_only_themselves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own: dict[str, Any] = {"policy": "zero", "env.tasks": "Slide", "trials": 12, "workers": 2, "stall_seconds": 3}
    own["env.factory"] = SLIDE
    assert_faults_cost_only_their_trials(evaluate, own, REASONS, tmp_path, monkeypatch)


def test_what_a_simulator_prints_is_no_answer_and_nonsense_has_a_cause(tmp_path: Path) -> None:
    own = {"policy": "zero", "env.tasks": "Slide", "trials": 1}
    (loud,) = evaluate(tmp_path / "a", **own, **{"env.options.says": "RKL1 I am no frame"})
    assert (loud.error, loud.steps) == (None, 20)
    (mad,) = evaluate(tmp_path / "b", **own, **{"env.options.nonsense": "I am no frame, but as long as one"})
    assert (mad.outcome, mad.attempts) == ("crashed", 2)
    assert "answered 'step' with nonsense: expected a frame, found the bytes b'I am no frame" in str(mad.error)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"env.python": "/no/such/python"}, "env.python: no file /no/such/python"),
        ({"env.python": str(ROOT / "README.md")}, "cannot be started"),
        ({"env.factory": "no_such_module:make"}, "No module named 'no_such_module'"),
        ({"env.factory": None}, "env.python without an env"),
        ({"env.tasks": "Slid"}, "Did you mean 'Slide'"),
        ({"env.python": None, "env.options.a": "1"}, "env.options are for envs of another interpreter"),
        ({"env.type": "pusht", "env.factory": None}, "expected lerobot:NAME"),
        ({"env.type": "lerobot:pusht"}, "env.type and env.factory exclude each other"),
        ({"perturbation.names": "camera"}, "perturbations of our kitchens"),
        ({"env.split": "pretrain"}, "splits are of our kitchens"),
        ({"env.task_sets": "atomic_seen"}, "env.task_sets are the kitchens'"),
        ({"env.horizon_multiplier": "2"}, "give env.horizon for an env of your own"),
    ],
)
def test_mistakes_are_said_before_anything_runs(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(UserError) as found:
        evaluate(tmp_path / "out", **changes)
    assert words in str(found.value)
    assert not (tmp_path / "out").exists()


def test_an_adapter_that_never_answers_is_ended_with_what_it_printed(tmp_path: Path) -> None:
    adapter = tmp_path / "slow.py"
    adapter.write_text("import time\nprint('asking the licence server', flush=True)\ntime.sleep(60)\n")
    message = r"(?s)no answer to 'hello' within 3 s and was ended; it last printed:\s+asking the licence server"
    with pytest.raises(UserError, match=message):
        evaluate(tmp_path / "out", **{"env.factory": f"{adapter}:Env", "stall_seconds": 3})


@pytest.mark.parametrize(
    ("name", "changes", "words"),
    [
        ("WithoutExpert", {"policy": "demonstrator"}, "its env has no expert"),
        ("PlainEnv", {"policy": "zero", "videos": 1, "env.options.pictures": "false"}, "there is nothing to film"),
        ("PlainEnv", {"env.image_size": 32}, r"(?s)cannot make its env.*unexpected keyword argument 'image_size'"),
        ("broken", {}, r"(?s)cannot make its env.*FileNotFoundError: no meshes of Slide"),
    ],
)
def test_what_no_other_trial_gets_around_ends_the_run(
    tmp_path: Path, name: str, changes: dict[str, Any], words: str
) -> None:
    with pytest.raises(UserError, match=words):
        evaluate(tmp_path / "out", **{"env.factory": f"{SUPPORT / 'foreign_envs.py'}:{name}"}, **changes)


def test_a_policy_that_looks_at_what_is_not_there_is_refused(tmp_path: Path, checkpoint: Path) -> None:
    own = {"policy": checkpoint, "policy.label": "tiny", "env.tasks": "Slide"}
    names = "observation.state of 1 numbers, observation.image"
    words = rf"policy 'tiny' looks at observation.state of 16 numbers, .*robot0_eye_in_hand, and the env shows {names}:"
    with pytest.raises(UserError, match=words):
        evaluate(tmp_path / "out", **own, **{"env.factory": f"{SUPPORT / 'foreign_envs.py'}:AnySize"})


def test_wrong_pictures_are_an_error_of_their_trial(tmp_path: Path) -> None:
    own = {"policy": "zero", "env.tasks": "Slide", "trials": 1, "videos": 1}
    (record,) = evaluate(tmp_path / "out", **own, **{"env.factory": f"{SUPPORT / 'foreign_envs.py'}:GreyEnv"})
    assert record.outcome == "crashed"
    assert "expected uint8 (height, width, 3)" in str(record.error)


def test_actions_of_a_wrong_size_are_refused_before_they_are_sent() -> None:
    env = ForeignEnv(Simulator(sys.executable, PLAIN), "Slide")
    try:
        env.reset(seed=1)
        with pytest.raises(UnfitPolicyError, match=r"of shape \(12,\), the env takes \(2,\)"):
            env.step(np.zeros(12))
        assert env.step(np.zeros(2))[0]["more"]["steps"] == 1
    finally:
        env.close()
    with pytest.raises(SimulatorError):
        env.step(np.zeros(2))


def test_frames_are_read_as_they_were_written_and_mutations_never_hang() -> None:
    rng = np.random.default_rng(5)
    arrays = {
        "pixels/top": rng.integers(0, 255, (4, 5, 3)).astype(np.uint8),
        "scalar": np.float64(2.5),
        "big": np.arange(3, dtype=">i8"),
        "strided": np.arange(12.0).reshape(3, 4)[:, ::2],
        "none": np.zeros((0, 3)),
    }
    stream = io.BytesIO()
    foreign_worker.write_frame(stream, {"ask": "step", "text": "öffne"}, arrays)
    whole = stream.getvalue()
    message, found = foreign_worker.read_frame(io.BytesIO(whole))
    assert message == {"ask": "step", "text": "öffne"}
    assert all(np.array_equal(found[name], value) for name, value in arrays.items())
    assert all(found[name].shape == np.shape(value) for name, value in arrays.items())
    read = 0
    for _ in range(500):
        mutated = bytearray(whole[: rng.integers(1, len(whole) + 1)] if rng.random() < 0.3 else whole)
        for place in rng.integers(0, len(mutated), rng.integers(1, 6)):
            mutated[place] = rng.integers(256)
        try:
            foreign_worker.read_frame(io.BytesIO(bytes(mutated)))
            read += 1
        except (foreign_worker.FrameError, EOFError):
            pass
    assert 0 < read < 500
    with pytest.raises(foreign_worker.FrameError, match="expected booleans or numbers"):
        foreign_worker.write_frame(io.BytesIO(), {}, {"objects": np.array([object()])})


def test_a_client_written_after_the_documentation_is_answered() -> None:
    text = (ROOT / "docs" / "simulators.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^\{\"ask\": .*\}$", text, flags=re.MULTILINE)
    action = np.zeros(2, "<f4").tobytes()
    frame = b"RKL1" + struct.pack(">IQ", len(example), len(action)) + example.encode() + action
    questions = io.BytesIO()
    foreign_worker.write_frame(questions, {"ask": "make", "factory": PLAIN, "task": "Slide", "arguments": {}})
    foreign_worker.write_frame(questions, {"ask": "reset", "seed": 0, "pictures": True})
    questions.write(frame)
    questions.seek(0)
    answers = io.BytesIO()
    foreign_worker.serve(questions, answers)
    answers.seek(0)
    said = [foreign_worker.read_frame(answers)[0] for _ in range(3)]
    assert [one["answers"] for one in said] == ["make", "reset", "step"]
    assert said[2]["reward"] == 0.0


def test_the_worker_answers_unknown_questions_and_goes_on() -> None:
    process = ForeignProcess(sys.executable)
    try:
        with pytest.raises(SimulatorError, match="unknown question 'fly'"):
            process.ask("fly")
        with pytest.raises(SimulatorError, match="TypeError"):
            process.ask("reset", wings=2)
        said, _ = process.ask("hello", factory=PLAIN, options={}, tasks=["Slide"])
        assert said["tasks"] == ["Slide", "Push"]
        os.kill(process.pid, signal.SIGKILL)
        with pytest.raises(SimulatorError, match="was ended by SIGKILL"):
            process.ask("expert")
    finally:
        process.close()


def test_the_worker_is_python_3_8_and_needs_only_numpy() -> None:
    source = Path(foreign_worker.__file__).read_text(encoding="utf-8")
    tree = ast.parse(source, feature_version=(3, 8))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.split(".")[0] for name in names} - set(sys.stdlib_module_names) == {"numpy"}


def test_settings_of_our_own_envs_are_as_before(tmp_path: Path) -> None:
    """Results of earlier versions go on: what is new stands in the settings only where it is used."""
    own = {"env.python": None, "env.factory": "evaluation_env:SlideEnv", "policy": "zero"}
    settings = engine.prepare(load_config(EvaluationConfig, arguments(tmp_path, **own))).header.settings
    assert not {"python", "type", "options", "simulator"} & settings.keys()
    assert {field.name for field in dataclasses.fields(Simulator)} == {"python", "factory", "options"}


def test_what_an_env_raised_survives_being_pickled() -> None:
    again = pickle.loads(pickle.dumps(EnvRaisedError("KeyError", "no such object")))
    assert (again.kind, str(again)) == ("KeyError", "no such object")
