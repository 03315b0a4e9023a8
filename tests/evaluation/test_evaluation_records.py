"""Plan, statistics, results file, settings: what an evaluation decides before and after the trials."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from evaluation_records import header, make_checkpoint, record
from hypothesis import given
from hypothesis import strategies as st

from robocasa_lerobot import contract
from robocasa_lerobot.envs.tasks.registry import task_names
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors import checkpoint as checkpoints
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig, PolicySettings, output_folder
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.planning.run_header import outcome_settings, plan_tasks
from robocasa_lerobot.evaluation.planning.trials import make_plan, trial_seed
from robocasa_lerobot.evaluation.records import results, trials_file
from robocasa_lerobot.evaluation.records.results import (
    ResultsError,
    RunHeader,
    TrialRecord,
)
from robocasa_lerobot.evaluation.run.serving import served_labels
from robocasa_lerobot.evaluation.statistics import success_rate, wilson_interval

ROOT = Path(__file__).parents[2]


# The last four: R. G. Newcombe, "Two-sided confidence intervals for the single proportion", Statistics in Medicine 17
# (1998), table I, method 3 (score without continuity correction), printed with four digits.
@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        (0, 10, 0.0, 0.2775),
        (10, 10, 0.7225, 1.0),
        (5, 10, 0.2366, 0.7634),
        (1, 1, 0.2065, 1.0),
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_interval_against_reference_values(successes: int, trials: int, low: float, high: float) -> None:
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=5.1e-5)


@given(st.integers(1, 400).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_interval_holds_the_rate_and_mirrors(pair: tuple[int, int]) -> None:
    successes, trials = pair
    rate = success_rate(successes, trials)
    assert 0 <= rate.low <= rate.rate <= rate.high <= 1
    mirrored = success_rate(trials - successes, trials)
    assert (1 - mirrored.high, 1 - mirrored.low) == pytest.approx((rate.low, rate.high))


@pytest.mark.parametrize(("successes", "trials"), [(0, 0), (3, 2), (-1, 5)])
def test_wilson_interval_refuses_impossible_counts(successes: int, trials: int) -> None:
    with pytest.raises(UserError, match="expected at least 1 trial"):
        wilson_interval(successes, trials)


def test_seeds_are_fixed_numbers() -> None:
    # Changing these makes results of older versions incomparable trial by trial.
    assert trial_seed(0, "OpenDrawer", 0) == 183955574
    assert trial_seed(0, "OpenDrawer", 1) == 1288256569


def test_plan_seeds_differ_between_trials_tasks_and_evaluations_but_not_between_policies() -> None:
    tasks = dict.fromkeys(["OpenDrawer", "CloseDrawer"], 100)
    plan = make_plan(["a", "b"], tasks, trials=50, seed=0, videos=2)
    assert len(plan) == 200
    by_policy = [[(s.task, s.trial, s.seed, s.policy_seed) for s in plan if s.label == label] for label in "ab"]
    assert by_policy[0] == by_policy[1]
    assert len({s.seed for s in plan}) == 100
    assert not {s.seed for s in plan} & {s.policy_seed for s in plan}
    assert not {s.seed for s in plan} & {s.seed for s in make_plan(["a"], tasks, 50, seed=1, videos=0)}
    assert [s.trial for s in plan if s.film] == [0, 1] * 4
    longer = make_plan(["b"], {"CloseDrawer": 100}, trials=60, seed=0, videos=0)
    assert [s.seed for s in longer][:50] == [s.seed for s in plan if s.label == "b" and s.task == "CloseDrawer"]


def write(path: Path, *items: RunHeader | TrialRecord) -> None:
    for item in items:
        trials_file.append(path, item)


def test_records_round_trip(tmp_path: Path) -> None:
    path = tmp_path / results.TRIALS_FILE
    written = [record(trial=i, instruction="Öffne\ndie „Schublade“") for i in range(3)]
    write(path, header(), *written)
    read = results.read_results(path)
    assert read.trials == written
    assert read == results.read_results(tmp_path)
    assert read.headers == {header().id: header()}
    assert read.header_of(written[0]).split == "target"
    assert read.policy_of(written[0]).step == 400
    write(path, dataclasses.replace(written[1], success=False, first_success_step=None))
    assert {r.trial: r.success for r in results.read_results(path).trials} == {0: True, 1: False, 2: True}


def test_a_torn_last_line_is_left_out_and_cut_off_at_every_length(tmp_path: Path) -> None:
    path = tmp_path / results.TRIALS_FILE
    whole = (header().to_line() + "\n" + record(trial=0).to_line() + "\n").encode()
    torn = record(trial=1).to_line().encode()
    for length in (1, len(torn) // 2, len(torn)):
        path.write_bytes(whole + torn[:length])
        assert [r.trial for r in results.read_results(path).trials] == [0]
        assert trials_file.drop_torn_line(path) == length
        assert path.read_bytes() == whole
    assert trials_file.drop_torn_line(path) == 0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("not json", "trials.jsonl:2: not a JSON object"),
        ("[1]", "found list, expected a JSON object"),
        (json.dumps({"schema": 99}), "schema 99, this version reads 3"),
        (json.dumps({"schema": 3, "kind": "dog"}), "kind 'dog', expected 'run' or 'trial'"),
        (record().to_line().replace('"success"', '"sucess"'), "unknown key 'sucess'. Did you mean 'success'"),
        (record().to_line().replace('"success": true', '"success": 1'), "'success' is 1, expected bool"),
        (record().to_line().replace('"steps": 80, ', ""), "missing key.s. steps"),
        (record().to_line().replace('"share"', '"shore"'), "unknown key 'terms.drawer_open.shore'"),
        (record(first_success_step=None).to_line(), "contradict each other"),
        (record(outcome="lost").to_line(), "outcome 'lost', expected one of finished"),
        (record(error="e").to_line(), "outcome 'finished' with error 'e'"),
        (record(run="0").to_line(), "run '0' has no header above it"),
        (record(label="other").to_line(), "policy 'other' is not in the header"),
        (header().to_line().replace('"trials": 10', '"trials": 99'), "it was edited"),
    ],
)
def test_a_bad_line_is_named(tmp_path: Path, line: str, message: str) -> None:
    path = tmp_path / results.TRIALS_FILE
    write(path, header())
    with path.open("a") as file:
        file.write(line + "\n")
    with pytest.raises(ResultsError, match=message):
        results.read_results(path)


def test_other_settings_weights_or_versions_are_refused_with_the_difference() -> None:
    old, check = header(), trials_file.check_same_run
    check(Path("t"), [old], header())
    check(Path("t"), [old], header("other", fingerprint="g"))
    changed: list[tuple[RunHeader, str]] = [
        (
            dataclasses.replace(old, settings={"seed": 0, "split": "pretrain"}),
            "split: 'target' in the file, 'pretrain'",
        ),
        (header(fingerprint="g"), "weights f in the file, g now"),
        (dataclasses.replace(old, versions={"robocasa_lerobot": "1"}), "robocasa_lerobot: 0 in the file, 1 now"),
    ]
    for new, message in changed:
        with pytest.raises(ResultsError, match=message):
            check(Path("t"), [old], new)


def test_trials_of_another_commit_are_mixed_with_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    old = dataclasses.replace(header(), git_commit="aaa")
    trials_file.check_same_run(Path("t"), [old], old)
    assert capsys.readouterr().err == ""
    trials_file.check_same_run(Path("t"), [old, old], dataclasses.replace(old, git_commit="bbb-dirty"))
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("t holds trials made at commit aaa of this package, and it is now at bbb-dirty")


def test_trials_of_another_torch_are_mixed_with_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    """Where checkpoints are computed: to other policies it is nothing."""
    old = header()
    old = dataclasses.replace(old, versions={**old.versions, "torch": "2.10.0", "lerobot": "0.6.1"})
    new = dataclasses.replace(old, versions={**old.versions, "torch": "2.11.0", "onnxruntime": "1.23"})
    trials_file.check_same_run(Path("t"), [old, old], new)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("t holds trials of policies computed with torch 2.10.0, and it is now torch 2.11.0")
    zero = dataclasses.replace(new, policies=header(type="zero").policies)
    trials_file.check_same_run(Path("t"), [dataclasses.replace(old, policies=zero.policies)], zero)
    assert capsys.readouterr().err == ""


def test_config_from_arguments_in_either_spelling() -> None:
    config = load_config(
        EvaluationConfig,
        [
            "--policy.path=random,zero",
            "--env.tasks=A,B",
            "--trials",
            "7",
            "--retry_errors",
            "--env.horizon_multiplier=1.5",
        ],
    )
    assert (config.policy.path, config.env.tasks, config.trials) == (["random", "zero"], ["A", "B"], 7)
    assert config.retry_errors is True
    assert config.env.horizon_multiplier == 1.5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--policy.path=zero", "--env.tasks=A", "--trails=3"], "unknown setting 'trails'. Did you mean 'trials'"),
        (["--policy.path=zero", "--env.taks=A"], "unknown setting 'env.taks'. Did you mean 'env.tasks'"),
        (["--policy.path=zero", "--env.tasks=A", "--trials=many"], "trials"),
        (["--policy.path=zero", "--env.tasks=A", "--trials=0"], "trials: found 0, expected at least 1"),
        (["--policy.path=zero", "--env.tasks=A", "--env.split=traget"], "Did you mean 'target'"),
        (["--policy.path=zero", "--env.tasks=A,A"], "A given twice"),
        (["--policy.path=zero", "--env.tasks=A", "--perturbation.names=none,none"], "none given twice"),
        (["--policy.path=zero", "--env.tasks=A", "--policy.lifelong_phase=-1"], "expected at least 0"),
        (
            ["--policy.path=zero", "--env.task_sets=lifelong_phase1", "--lifelong=true", "--policy.lifelong_phase=0"],
            "give --lifelong=false",
        ),
        (["--policy.path=zero", "--env.tasks=A", "--env.horizon_multiplier=.inf"], "horizon_multiplier: found inf"),
        (["--policy.path=zero", "--env.tasks=A", "--stall_seconds=.nan"], "stall_seconds: found nan"),
        (
            [
                "--policy.path=zero",
                "--env.tasks=A",
                "--env.horizon=9",
                "--success.rule=hold",
                "--success.hold_steps=10",
            ],
            "a trial lasts 9 steps",
        ),
        (["--policy.path=zero"], "no task: give --env.tasks"),
        (["--env.tasks=A"], "no policy: give --policy.path"),
        (["--env=A"], "env: found 'A', expected settings"),
        (["A"], "unexpected argument 'A'"),
    ],
)
def test_bad_arguments_are_explained(arguments: list[str], message: str) -> None:
    with pytest.raises(UserError, match=message):
        load_config(EvaluationConfig, arguments)


@pytest.mark.parametrize("path", sorted((ROOT / "configs/evaluations").glob("*.yaml")), ids=lambda p: p.stem)
def test_every_evaluation_file_parses_and_can_be_run_with_the_tasks_that_are_there(path: Path) -> None:
    config = load_config(EvaluationConfig, [f"--config_path={path}", "--policy=zero", "--policy.lifelong_phase=1"])
    assert config.protocol == path.stem
    config.env.tasks = config.env.tasks or ["OpenDrawer"]
    planned = plan_tasks(config.env)
    assert set(planned.horizons) <= set(task_names())
    assert set(planned.sets) == set(config.env.task_sets)


def test_horizons_come_from_the_registry_times_the_multiplier() -> None:
    config = load_config(EvaluationConfig, ["--policy.path=zero", "--env.tasks=OpenDrawer"])
    own = plan_tasks(config.env).horizons["OpenDrawer"]
    assert own is not None
    config.env.horizon_multiplier = 1.5
    assert plan_tasks(config.env).horizons == {"OpenDrawer": round(1.5 * own)}
    config.env.tasks = ["OpenDrawr"]
    with pytest.raises(UserError, match="Did you mean 'OpenDrawer'"):
        plan_tasks(config.env)


def test_a_folder_of_many_policies_has_a_name_that_file_systems_take() -> None:
    config = load_config(EvaluationConfig, ["--policy.path=zero", "--env.tasks=A"])
    labels = [f"experiment_of_a_long_name_{number}/finetune-{number:06d}" for number in range(8)]
    assert output_folder(config, labels[:2]).name == "-".join(label.replace("/", "__") for label in labels[:2])
    names = {output_folder(config, labels[:count]).name for count in (7, 8)}
    assert len(names) == 2
    assert all(len(name.encode()) < 255 for name in names)


def test_settings_that_cannot_change_an_outcome_are_not_compared() -> None:
    one = load_config(EvaluationConfig, ["--policy.path=zero", "--env.tasks=A"])
    other = load_config(
        EvaluationConfig,
        ["--policy.path=random", "--env.tasks=A,B", "--workers=7", "--videos=5", "--trials=99", "--out=x"],
    )
    assert outcome_settings(one, 64) == outcome_settings(other, 64)


def test_a_checkpoint_tells_its_label_size_and_fingerprint(tmp_path: Path) -> None:
    folder = make_checkpoint(tmp_path / "demo/finetune/checkpoints/000400/pretrained_model")
    (folder.parents[1] / "last").symlink_to("000400")
    source = checkpoints.read_source(str(folder.parents[1] / "last/pretrained_model"))
    assert (source.label, source.phase, source.step, source.image_size) == (
        "finetune-000400",
        "finetune",
        400,
        (64, 64),
    )
    assert source.path == str(folder.resolve())  # a later checkpoint becomes `last`, and is not this one
    # The phase's folder and the checkpoint's are understood as well.
    for place in (folder, folder.parent, tmp_path / "demo/finetune"):
        assert checkpoints.read_source(str(place)).fingerprint == source.fingerprint
    (folder / "model.safetensors").write_bytes(b"other")
    assert checkpoints.read_source(str(folder)).fingerprint != source.fingerprint


def test_bad_checkpoints_are_explained(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such folder; expected a pretrained_model folder"):
        checkpoints.read_source(str(tmp_path / "nothing"))
    good = make_checkpoint(tmp_path / "demo/pretrain/checkpoints/000001/pretrained_model")
    with pytest.raises(UserError, match=f"Did you mean {good}"):
        checkpoints.read_source(str(tmp_path / "demo"))
    (good / "model.safetensors").unlink()
    with pytest.raises(UserError, match="the checkpoint is incomplete"):
        checkpoints.read_source(str(good))
    (good / "adapter_model.safetensors").touch()
    with pytest.raises(UserError, match=r"adapter of PEFT alone .*merge_and_unload"):
        checkpoints.read_source(str(good))


def test_policies_of_different_picture_sizes_do_not_share_an_evaluation(tmp_path: Path) -> None:
    sources = [checkpoints.read_source(str(make_checkpoint(tmp_path / f"c{size}", size))) for size in (64, 96)]
    with pytest.raises(UserError, match="different picture sizes"):
        checkpoints.common_image_size(sources, None)
    assert checkpoints.common_image_size(sources, 96) == 96
    assert checkpoints.common_image_size(sources[:1], None) == 64
    assert checkpoints.common_image_size([checkpoints.read_source("zero")], None) == contract.IMAGE_SIZE


def hub_checkpoint(folder: Path, rename: dict[str, str], **config: Any) -> Path:
    """As pi0's weights on the hub: cameras of another robot at 224 pixels, and what LeRobot saves to rename ours."""
    folder.mkdir()
    slots = ("base_0_rgb", "left_wrist_0_rgb", "empty_camera_0")
    features = {f"observation.images.{name}": {"type": "VISUAL", "shape": [3, 224, 224]} for name in slots}
    features["observation.state"] = {"type": "STATE", "shape": [32]}
    (folder / "config.json").write_text(json.dumps({"type": "pi0", "input_features": features, **config}))
    (folder / "model.safetensors").write_bytes(b"w")
    step = {"registry_name": "rename_observations_processor", "config": {"rename_map": rename}}
    (folder / "policy_preprocessor.json").write_text(json.dumps({"steps": [step]}))
    return folder


def test_cameras_of_other_names_are_those_that_the_saved_preprocessor_renames(tmp_path: Path) -> None:
    rename = {contract.IMAGE_KEYS[0]: "observation.images.base_0_rgb"}
    source = checkpoints.read_source(str(hub_checkpoint(tmp_path / "renamed", rename)))
    assert checkpoints.common_image_size([source], None) == 224
    with pytest.raises(UserError, match=r"base_0_rgb.* renames none of these"):
        checkpoints.read_source(str(hub_checkpoint(tmp_path / "not", {})))


def test_policies_are_served_by_one_process_for_each_gpu_where_a_chunk_follows_from_one_look(tmp_path: Path) -> None:
    kinds = ("act", "diffusion_transformer", "flow_vla", "groot", "pi0", "pi05", "smolvla", "xvla")
    rename = {contract.IMAGE_KEYS[0]: "observation.images.base_0_rgb"}
    for kind in kinds:
        folder = hub_checkpoint(tmp_path / kind, rename, type=kind)
        sources = {kind: checkpoints.read_source(str(folder), kind)}
        assert served_labels(sources, PolicySettings(path=[kind]), "cuda") == {kind}
        assert served_labels(sources, PolicySettings(path=[kind]), "cpu") == set()
    for number, changes in enumerate(({"n_obs_steps": 2}, {"temporal_ensemble_coeff": 0.01}, {"type": "diffusion"})):
        folder = hub_checkpoint(tmp_path / str(number), rename, **{"type": "act", **changes})
        assert served_labels({"p": checkpoints.read_source(str(folder))}, PolicySettings(path=["p"]), "cuda") == set()


def test_noise_for_a_whole_batch_is_drawn_for_one_observation_at_a_time() -> None:
    config = load_config(EvaluationConfig, ["--policy.path=x", "--env.tasks=A"])

    def width(*kinds: str, device: str = "cuda") -> int:
        return int(outcome_settings(config, 64, device, kinds)["batch_width"])

    assert [width(kind) for kind in ("act", "flow_vla", "groot", "pi0", "smolvla")] == [8, 8, 1, 1, 1]
    assert (width("flow_vla", "groot"), width("flow_vla", device="cpu")) == (1, 1)


def test_what_computes_a_policy_is_a_setting_where_it_makes_a_difference() -> None:
    def runtime(*kinds: str, device: str = "cpu", asked: str = "onnx") -> object:
        arguments = ["--policy.path=x", "--env.tasks=A", f"--policy.runtime={asked}"]
        return outcome_settings(load_config(EvaluationConfig, arguments), 64, device, kinds).get("runtime")

    assert [runtime("act", kind) for kind in ("diffusion_transformer", "flow_vla")] == ["onnx"] * 2
    # Runs of before ONNX Runtime have none, and go on with torch.
    assert [runtime("act"), runtime(), runtime("flow_vla", device="cuda"), runtime("flow_vla", asked="torch")] == [
        None
    ] * 4
    with pytest.raises(UserError, match=r"policy.runtime 'onx'.*onnx"):
        runtime("flow_vla", asked="onx")


def test_the_saved_configuration_loads_again(tmp_path: Path) -> None:
    config = load_config(EvaluationConfig, ["--policy.path=zero", "--env.tasks=A,B", "--seed=3"])
    path = tmp_path / "evaluation.yaml"
    path.write_text(yaml.safe_dump(dataclasses.asdict(config)))
    assert load_config(EvaluationConfig, [f"--config_path={path}"]) == config
