"""The training benchmark's own machinery, on next to nothing; the figures are nobody's test."""

from __future__ import annotations

import dataclasses
import importlib
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import torch
import yaml

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError

REPOSITORY = Path(__file__).parents[2]
BENCHMARKS = REPOSITORY / "benchmarks"
RESULT = BENCHMARKS / "results" / "training_speed.json"


@pytest.fixture(autouse=True)
def programs_on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        return module("training_data").fake(tmp_path_factory.mktemp("data"), episodes=2, image_size=32, frames=16)


def module(name: str) -> ModuleType:
    return importlib.import_module(name)


def job(dataset: Path, folder: Path, **changes: Any) -> Any:
    sides = module("training_sides")
    tiny = sides.policy_settings("demo") | {"image_size": None, "width": 16, "n_heads": 2}
    settings = {"batch_size": 2, "window": 1, "windows": 2, **changes}
    return sides.Job(policy=tiny, dataset=dataset, device="cpu", folder=folder / "job", **settings)


def test_options() -> None:
    parse = module("training_speed").parse
    assert parse([]).quick is parse([]).fake is parse([]).loaders_only is False
    options = parse(["--quick", "--device", "cpu", "--workers", "0", "3", "--output", "x.json"])
    assert (options.quick, options.device, options.workers, options.output) == (True, "cpu", [0, 3], Path("x.json"))
    with pytest.raises(SystemExit):
        parse(["--device", "gpu"])


def test_what_a_user_gets_wrong_is_explained(tmp_path: Path, dataset: Path) -> None:
    with pytest.raises(UserError, match="no LeRobotDataset"):
        module("training_data").check(tmp_path)
    assert module("training_data").check(dataset) == dataset
    with pytest.raises(UserError, match=r"no preset 'demmo'.*compact, demo"):
        module("training_sides").policy_settings("demmo")


@pytest.mark.parametrize(
    ("device", "cores", "counts"), [("cpu", 2, (0, 2)), ("cpu", 64, (0, 4)), ("cuda", 16, (4, 16))]
)
def test_every_side_gets_the_same_numbers_of_loader_processes(device: str, cores: int, counts: tuple[int, ...]) -> None:
    assert module("training_speed").worker_counts(device, cores) == counts
    sides = module("training_sides").sides(counts, counts[:1])
    report = module("training_report")
    for kind in report.WORDS:
        found = [side.workers for side in sides if side.kind == kind]
        assert found == list(counts[:1] if kind == report.CACHED else counts)
    assert len({side.key for side in sides}) == len(sides)


def test_both_sides_train_the_same_policy_on_the_same_data(tmp_path: Path, dataset: Path) -> None:
    sides = module("training_sides")
    work = job(dataset, tmp_path)
    theirs = sides.lerobot_settings(sides.Side("lerobot", 2), work, tmp_path / "out")
    ours = sides.our_settings(sides.Side("decoding", 2), work, tmp_path / "out")
    (phase,) = ours["phases"]
    assert ours["policy"].items() <= theirs["policy"].items()
    assert set(theirs["policy"]) - set(ours["policy"]) == {"device", "push_to_hub"}
    assert theirs["policy"]["device"] == ours["device"]
    assert [member["root"] for member in phase["mixture"]["members"]] == [theirs["dataset"]["root"]]
    assert (phase["steps"], phase["batch_size"]) == (theirs["steps"], theirs["batch_size"]) == (3, 2)
    assert theirs["num_workers"] == ours["loader"]["workers"] == 2
    assert phase["ema"] == {"enabled": False}  # LeRobot has none
    assert ours["loader"]["cache_frames"] is False
    assert sides.our_settings(sides.Side("cached", 0), work, tmp_path)["loader"]["cache_frames"] is True


def test_lerobots_log_is_read_by_the_clock(tmp_path: Path, dataset: Path) -> None:
    sides = module("training_sides")
    line = "INFO step:{} smpl:8 ep:1 epch:0.5 loss:0.5{} grdn:1.0 lr:1.0e-04 updt_s:0.300 data_s:0.100 smp/s:5\n"
    lines = [(0.0, "starting\n"), *((10.0 * i, line.format(i, i)) for i in (1, 2, 3))]
    found = sides._read_log(lines, job(dataset, tmp_path))
    assert found == pytest.approx({"samples_per_second": 2 * 1 * 2 / 20.0, "data_share": 0.25, "loss": 0.53})
    with pytest.raises(UserError, match="wrote 2 lines of figures, expected 3"):
        sides._read_log(lines[:-1], job(dataset, tmp_path))


def test_our_metrics_are_read_without_the_first_window(tmp_path: Path) -> None:
    def line(seconds: float, waited: float, loss: float) -> str:
        values = {"seconds_per_step": seconds, "data_seconds_per_step": waited, "loss": loss}
        return json.dumps(values | {"samples_per_second": 8 / seconds}) + "\n"

    path = tmp_path / "metrics.jsonl"
    path.write_text(line(100, 90, 3) + line(1, 0.1, 2) + line(3, 0.3, 1))
    found = module("training_sides").read_metrics(path)
    assert found == pytest.approx({"samples_per_second": 2 * 8 / 4, "data_share": 0.1, "loss": 1})


def test_a_training_that_fails_says_why(tmp_path: Path, dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "program.py"
    program.write_text("print('out of memory'); raise SystemExit(7)\n")
    sides = module("training_sides")
    with pytest.raises(UserError, match=r"ended with 7:\nout of memory"):
        list(sides._lines([sides.sys.executable, str(program)]))


def test_loaders_give_the_same_samples(tmp_path: Path, dataset: Path) -> None:
    loaders = module("training_loaders")
    windows = loaders.windows_for(n_obs_steps=2, chunk=10)
    assert {len(windows[key]) for key in (*contract.IMAGE_KEYS, contract.STATE_KEY)} == {2}
    assert len(windows[contract.ACTION_KEY]) == 10
    seen: dict[int, list[dict[str, torch.Tensor]]] = {}
    for kind in (loaders.LEROBOT, loaders.DECODING, loaders.CACHED):
        batches = loaders.open_loader(kind, dataset, windows, batch_size=8, workers=0, cache=tmp_path)
        for _ in range(4):  # 32 frames are the whole dataset, so that all loaders meet in some of them
            batch = next(batches)
            for i, index in enumerate(batch["index"].tolist()):
                keys = (*contract.IMAGE_KEYS, contract.STATE_KEY, contract.ACTION_KEY, "action_is_pad")
                seen.setdefault(index, []).append({key: batch[key][i] for key in keys})
    assert max(len(of_frame) for of_frame in seen.values()) >= 3
    for first, *others in seen.values():
        for other in others:
            for key, value in first.items():
                assert other[key].dtype == value.dtype
                torch.testing.assert_close(other[key], value, msg=f"{key} differs")


def test_a_loaders_rate_is_over_whole_batches() -> None:
    rate = module("training_loaders").samples_per_second(iter(range(10)), batch_size=4, seconds=0.0)
    assert rate > 0


def test_lerobots_samples_come_by_number(dataset: Path) -> None:
    loaders = module("training_loaders")
    lerobot = loaders.lerobot_dataset(dataset, loaders.windows_for(1, 10))
    batches = loaders.LeRobotBatches(lerobot, batch_size=8)
    wanted = list(loaders.lerobot_sampler(lerobot))
    for number in (3, 0, 4):  # 32 frames: number 4 begins again
        first = number * 8 % 32
        assert batches[number]["index"].tolist() == wanted[first : first + 8]
    assert batches[0][contract.IMAGE_KEYS[0]].dtype == torch.uint8


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lerobot", "same_loader", "decoding", "cached"])
def test_every_side_trains(kind: str, tmp_path: Path, dataset: Path) -> None:
    sides = module("training_sides")
    found = sides.run(sides.Side(kind, 0), job(dataset, tmp_path))
    assert set(found) == {"samples_per_second", "data_share", "loss"}
    assert found["samples_per_second"] > 0
    assert 0 <= found["data_share"] < 1
    assert 0 < found["loss"] < 5


def example_result() -> dict[str, Any]:
    """A result with made-up figures, in which our loop alone is a little too slow."""
    speed, report, common = (module(f) for f in ("training_speed", "training_report", "common"))
    rates = {"lerobot_0": 10.0, "lerobot_2": 20.0, "same_loader_0": 50.0, "same_loader_2": 19.0,
             "decoding_0": 30.0, "decoding_2": 10.0, "cached_0": 40.0}  # fmt: skip
    training = {
        "demo": {
            key: {
                "samples_per_second": common.spread([rate / 2, rate, 2 * rate]),
                "data_share": common.spread([0.2]),
                "loss": common.spread([1.0]),
            }
            for key, rate in rates.items()
        }
    }
    alone = {"lerobot": 4.0, "decoding": 6.0, "cached": 40.0}
    loaders = {
        f"{o}x{c}": {kind: common.spread([rate]) for kind, rate in alone.items()}
        for o in speed.OBSERVATIONS
        for c in speed.CHUNKS
    }
    return {
        "mode": "quick", "machine": common.machine(), "device": "cpu",
        "versions": {"lerobot": "0", "commit": "unknown"}, "lerobot_decodes_with": "pyav",
        "dataset": {"kind": "made-up", "episodes": 2, "frames": 32, "cameras": {}},
        "ratios": report.ratios(training, loaders), "training": training, "loaders": loaders,
        "others_share_of_cores": common.spread([0.3]), "effort": {**dataclasses.asdict(speed.QUICK), "workers": [0, 2]},
    }  # fmt: skip


def check_result(result: dict[str, Any]) -> None:
    assert result["benchmark"] == "training_speed"
    assert re.match(r"20\d\d-\d\d-\d\dT", result["date"])
    assert {"cpu", "cores", "memory_gib", "python"} <= set(result["machine"])
    assert {"lerobot", "commit"} <= set(result["versions"])
    assert result["ratios"] == pytest.approx(module("training_report").ratios(result["training"], result["loaders"]))
    assert {f"loader_{o}x{c}_cached" for o in (1, 2) for c in (10, 50)} <= set(result["ratios"])
    assert str(REPOSITORY) not in json.dumps(result)
    assert module("training_report").report(result).count("\n") > 20


def test_the_demo_is_measured_in_its_own_batches_too() -> None:
    speed = module("training_speed")
    own = yaml.safe_load((REPOSITORY / "configs/experiments/demo.yaml").read_text())["defaults"]["batch_size"]
    for effort in (speed.QUICK, speed.FULL):
        policy, batch, _ = effort.trainings[f"demo_of_{own}"]
        assert (policy, batch) == ("demo", own)
        assert effort.trainings["demo"][1] == effort.batch_size == 8, "LeRobot's default"
    assert list(speed.QUICK_GPU.trainings) == ["compact"]


def test_ratios_take_the_best_of_each_side_and_equal_workers_for_the_loop() -> None:
    ratios = example_result()["ratios"]
    assert ratios["demo_same_loader"] == pytest.approx(19 / 20)  # with as many processes as LeRobot's best
    assert ratios["demo_decoding"] == pytest.approx(30 / 20)
    assert ratios["demo_cached"] == pytest.approx(40 / 20)
    assert ratios["loader_2x50_decoding"] == pytest.approx(1.5)
    assert module("training_report").promised("demo_cached") == 1.3
    assert module("training_report").promised("loader_2x50_cached") is None


def test_results_are_written_whole_and_reported(tmp_path: Path) -> None:
    path = tmp_path / "training_speed.json"
    module("common").write_result(path, "training_speed", example_result())
    check_result(json.loads(path.read_text()))
    report = module("training_report").report
    text = report(example_result())
    assert re.search(r"demo_same_loader +0\.95 +>= 1 +NOT MET", text)
    assert re.search(r"demo_cached +2\.00 +>= 1\.3 +met", text)
    assert "NOT QUIET" in text
    assert "LeRobot decodes with pyav, since torchcodec finds no FFmpeg." in text
    assert "decodes with torchcodec.\n" in report({**example_result(), "lerobot_decodes_with": "torchcodec"})
    assert "waits 20.0% of the time" not in text  # a promise about GPUs
    assert "waits 20.0% of the time (wanted: at most 10%), NOT MET" in report({**example_result(), "device": "a GPU"})


@pytest.mark.skipif(not RESULT.exists(), reason="no measured result in this checkout")
def test_stored_result_is_complete() -> None:
    check_result(json.loads(RESULT.read_text(encoding="utf-8")))


@pytest.mark.slow
def test_the_whole_command_without_training(tmp_path: Path, dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    speed = module("training_speed")
    tiny = dataclasses.replace(speed.QUICK, repetitions=1, batch_size=2, loader_seconds=0.01)
    monkeypatch.setattr(speed, "QUICK", tiny)
    monkeypatch.setattr(speed, "WORK", tmp_path / "work")
    output = tmp_path / "out.json"
    arguments = ["--quick", "--device", "cpu", "--loaders-only", "--dataset", str(dataset), "--output", str(output)]
    assert speed.main(arguments) == 0
    result = json.loads(output.read_text())
    assert result["training"] == {}
    check_result(result)
