"""The conversion benchmark's own machinery, on next to nothing; the figures are nobody's test."""

from __future__ import annotations

import importlib
import json
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import av
import h5py
import numpy as np
import pytest
from convert_support import write_demos

from robocasa_lerobot import contract
from robocasa_lerobot.convert import pipeline
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.video import frames_and_rate, read_frames

REPOSITORY = Path(__file__).parents[2]
BENCHMARKS = REPOSITORY / "benchmarks"
RESULT = BENCHMARKS / "results" / "convert_speed.json"


@pytest.fixture(autouse=True)
def programs_on_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)


def module(name: str) -> ModuleType:
    return importlib.import_module(name)


def test_options() -> None:
    parse = module("convert_speed").parse
    assert parse([]).quick is parse([]).without_peer is parse([]).without_memory is False
    options = parse(["--quick", "--output", "x.json", "--work", "w"])
    assert options.quick is True
    assert (options.output, options.work) == (Path("x.json"), Path("w"))
    with pytest.raises(SystemExit):
        parse(["--quickly"])


def test_every_part_has_a_row_and_what_ratios_need_is_measured() -> None:
    speed, report = module("convert_speed"), module("convert_report")
    keys = [part.key for part in speed._parts(peer=True)]
    keys += [f"states_scenes_{n}" for n in report.PROCESSES]  # measured with the renderer
    assert sorted(keys) == sorted(report.ROWS)
    assert {key for ours, other, _ in report.RATIOS.values() for key in (ours, other)} <= set(keys)
    alone = {part.key for part in speed._parts(peer=False)}
    assert {key for key in set(keys) - alone if not key.startswith("states_scenes")} == {
        key for key in keys if key.startswith("lift_")
    }
    for effort in (speed.QUICK, speed.FULL):
        assert list(effort.memory_episodes) == sorted(effort.memory_episodes)
        assert effort.slow_repetitions <= effort.repetitions


@pytest.mark.parametrize("processes", [1, 2, 3])
def test_demos_are_dealt_once_each_and_evenly(processes: int) -> None:
    lengths = {f"demo_{i}": length for i, length in enumerate((7, 1, 5, 4, 3, 6))}
    hands = module("convert_demos").deal(lengths, processes)
    assert sorted(name for hand in hands for name in hand) == sorted(lengths)
    loads = [sum(lengths[name] for name in hand) for hand in hands]
    assert len(loads) == processes
    assert max(loads) - min(loads) <= 2


def test_a_stripped_file_has_the_same_states_and_nothing_to_see(tmp_path: Path) -> None:
    demos = module("convert_demos")
    path = write_demos(tmp_path / "a.hdf5", (5, 3), images=32)
    with h5py.File(path) as source, h5py.File(tmp_path / "b.hdf5", "w") as target:
        demos.strip(source, target, steps=4)
        for name, length in (("demo_0", 4), ("demo_1", 3)):
            ours, theirs = target["data"][name], source["data"][name]
            assert set(ours) == {"states", "actions"}
            assert ours.attrs["num_samples"] == length
            assert ours.attrs["model_file"] == theirs.attrs["model_file"]
            np.testing.assert_array_equal(ours["states"], theirs["states"][:length])
            np.testing.assert_array_equal(ours["actions"], theirs["actions"][:length])
        assert target["data"].attrs["total"] == 7
        assert set(target["assets"]) == set(source["assets"])
    assert demos.demo_lengths(tmp_path / "b.hdf5") == {"demo_0": 4, "demo_1": 3}
    with np.load(demos.states_for_peer(tmp_path / "b.hdf5")) as states:
        assert {name: len(rows) for name, rows in states.items()} == {"demo_0": 4, "demo_1": 3}


@pytest.mark.slow  # installs robosuite once
@pytest.mark.render
def test_lift_comes_from_the_package_that_carries_it(tmp_path: Path) -> None:
    demos = module("convert_demos")
    try:
        assets = demos.lift_assets()
    except module("venvs").VenvError as error:
        pytest.skip(str(error))
    path = demos.cut_lift(tmp_path, 2, assets)
    assert list(demos.demo_lengths(path).values()) == [2, 2, 2]
    settings = ConversionSettings(asset_roots=(str(assets),), image_size=32)
    assert pipeline.convert([path], tmp_path / "lift", settings).num_frames == 6


def test_tiny_episodes_convert_and_ours_decode(tmp_path: Path) -> None:
    demos, work = module("convert_demos"), module("convert_work")
    file = demos.tiny(tmp_path, 3)
    assert list(demos.demo_lengths(file).values()) == [demos.TINY_FRAMES] * 3
    out = tmp_path / "out"
    answer = work.convert(str(file), str(out), workers=1)
    assert answer["frames"] == 3 * demos.TINY_FRAMES
    assert answer["seconds"] > 0
    assert answer["cpu_s"] > 0
    answer = work.decode(str(out), batches=1, seed=0)
    assert answer["frames"] == work.BATCH
    assert answer["cameras"] == len(contract.CAMERAS)
    assert answer["size"] == [work.BATCH, 3, demos.TINY_SIZE, demos.TINY_SIZE]


def test_the_encoder_alone_writes_every_picture_as_our_converter_does(tmp_path: Path) -> None:
    work = module("convert_work")
    file = write_demos(tmp_path / "a.hdf5", (9, 6), images=64)
    reference = tmp_path / "reference"
    work.convert(str(file), str(reference), workers=1)
    encoding = work.Encoding()
    loaded = encoding.load_pictures(str(file), ["demo_0", "demo_1"], str(reference))
    assert loaded["mib"] * 2**20 == 15 * 3 * 64 * 64 * 3
    out = tmp_path / "videos"
    assert encoding.encode(["demo_0", "demo_1"], str(out), at=0.0)["frames"] == 15
    for index, length in enumerate((9, 6)):
        for camera in contract.CAMERAS:
            with av.open(str(out / f"demo_{index}-{camera}_image.mp4")) as container:
                alone = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
            assert len(alone) == length
    # The same codec, the same options: the same pictures.
    (video,) = (reference / "videos" / contract.image_key(contract.CAMERAS[-1])).glob("*/*.mp4")
    with av.open(str(video)) as container:
        ours = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    # The same codec on the same pictures; FFmpeg averages colours a little otherwise than we do.
    assert np.abs(np.array(ours[9:], int) - np.array(alone, int)).mean() < 1


def test_lerobots_own_path_records_the_same_demos(tmp_path: Path) -> None:
    work = module("convert_work")
    file = write_demos(tmp_path / "a.hdf5", (6, 4), images=64)
    with h5py.File(file, "r+") as demos:  # with stages, as our demonstrators tell them
        for demo in demos["data"].values():
            demo["stage"] = np.zeros(len(demo["actions"]), np.int32)
            stages = {"stages": [{"text": "open the drawer", "skill": "open"}]}
            demo.attrs["ep_meta"] = json.dumps(json.loads(demo.attrs["ep_meta"]) | stages)
    reference, out = tmp_path / "reference", tmp_path / "lerobot"
    work.convert(str(file), str(reference), workers=1)
    assert work.record_with_lerobot(str(file), str(reference), str(out), render=False)["frames"] == 10
    for key in (contract.STATE_KEY, contract.ACTION_KEY):
        np.testing.assert_array_equal(work.column(out, key), work.column(reference, key))
    features = json.loads((out / "meta" / "info.json").read_text())["features"]
    assert features[contract.IMAGE_KEYS[0]]["info"]["video.codec"] == "av1"  # its default, not ours
    alike = tmp_path / "alike"
    assert work.record_with_lerobot(str(file), str(reference), str(alike), render=False, alike=True)["frames"] == 10
    for camera in contract.CAMERAS:  # the same codec on the same pictures, and none is missing
        (one,), (other,) = ((root / "videos").glob(f"*{camera}/*/*.mp4") for root in (reference, alike))
        ours, theirs = (np.array(read_frames(path, range(10)), int) for path in (one, other))
        assert frames_and_rate(other) == frames_and_rate(one) == (10, contract.CONTROL_HZ)
        assert np.abs(ours - theirs).mean() < 1
    kept = json.loads((reference / "meta" / "info.json").read_text())["features"]
    assert set(kept) - set(features) == {contract.LANGUAGE_KEY}


@pytest.mark.render
def test_the_renderer_alone_draws_what_our_converter_draws(tmp_path: Path) -> None:
    work = module("convert_work")
    render, scenes, settings = (
        module(f"robocasa_lerobot.convert.{name}") for name in ("render", "scenes.compiled", "settings")
    )
    file = write_demos(tmp_path / "a.hdf5", (3,))
    answer = work.render(str(file), ["demo_0"], at=0.0)
    assert answer["frames"] == 3
    assert answer["loading_s"] > 0
    with h5py.File(file) as source:
        scene = work.RecordedScene(source, "demo_0")
        mine = scene.pictures(2, list(contract.CAMERAS))
        scene.close()
        group = source["data/demo_0"]

        def embedded(path: str) -> bytes | None:
            stored = source.get(f"assets/{path}")
            return None if stored is None else stored[()].tobytes()

        finder = work.AssetFinder([], embedded)
        text = work.loadable(group.attrs["model_file"], finder)
        with render.Scene(scenes.CompiledScene.of(*text)) as ours:
            ours.set_state(group["states"][2])
            for camera, picture in mine.items():
                assert picture.std() > 5
                seen = ours.pictures([settings.Camera(camera, *picture.shape[:2])])
                np.testing.assert_array_equal(seen[camera], picture)


def test_memory_of_a_command_and_one_that_fails() -> None:
    memory, workers = module("convert_memory"), module("workers")
    found = memory.run_command(["tasks"])  # imports the kitchens: seconds, where a command's help ends between samples
    assert found["seconds"] > 0
    assert found["peak_mib"] > 20
    assert found["processes"] >= 1
    with pytest.raises(workers.WorkerError, match="unknown command"):
        memory.run_command(["convrt"])


def example_result() -> dict[str, Any]:
    """Made-up figures: every rate is 10, but for one of ours, which misses nothing, and the memory grows."""
    spread, report = module("common").spread, module("convert_report")
    rates = {key: spread([10.0, 9.0, 12.0]) for key in report.ROWS}
    rates["images_ours_1"] = spread([60.0, 50.0, 70.0])
    run = {"seconds": 10.0, "peak_mib": 500.0, "processes": 3}
    memory = {"10": run, "100": run, "1000": {**run, "peak_mib": 900.0}}
    return {
        "mode": "quick", "machine": module("common").machine(), "versions": {"lerobot": "0", "commit": "unknown"},
        "ratios": report.ratios(rates, memory), "frames_per_second": rates, "memory": memory,
        "cpu_ms_per_step": {key: spread([3.0]) for key in report.ROWS if not key.endswith("_2")},
        "commands": {f"{kind}_{n}": {**run, "frames": 500} for kind in ("images", "states") for n in (1, 2)},
        "startup": {"process_s": 5.0, "two_workers_s": 6.0},
        "scene_loading": {"seconds_per_demo": 0.2, "share_of_drawing": 0.1},
        "dataset_mib": {"images_ours_1": 3.0}, "demos": {"task": "t", "lengths": [5, 5], "frames": 10},
        "peer": {}, "others_share_of_cores": spread([0.0, 0.3]), "effort": {},
    }  # fmt: skip


def check_result(result: dict[str, Any], not_yet: frozenset[str] = frozenset()) -> None:
    """Whether a result is whole, but for rows that came after it was measured."""
    report = module("convert_report")
    assert result["benchmark"] == "convert_speed"
    assert re.match(r"20\d\d-\d\d-\d\dT", result["date"])
    assert {"cpu", "cores", "memory_gib", "python"} <= set(result["machine"])
    assert {"lerobot", "commit"} <= set(result["versions"])
    assert set(result["frames_per_second"]) == set(report.ROWS) - not_yet
    for figures in result["frames_per_second"].values():
        assert 0 < figures["min"] <= figures["median"] <= figures["max"]
    ratios = {name: (ours, other) for name, (ours, other, _) in report.RATIOS.items() if not not_yet & {ours, other}}
    assert set(result["ratios"]) == {*ratios, report.MEMORY_RATIO}
    for name, (ours, other) in ratios.items():
        medians = [result["frames_per_second"][key]["median"] for key in (ours, other)]
        assert result["ratios"][name] == pytest.approx(medians[0] / medians[1])
    peaks = [run["peak_mib"] for _, run in sorted(result["memory"].items(), key=lambda item: int(item[0]))]
    assert len(peaks) >= 3
    assert result["ratios"][report.MEMORY_RATIO] == pytest.approx(peaks[-1] / peaks[0])
    assert sum(result["demos"]["lengths"]) == result["demos"]["frames"]
    assert report.report(result).count("\n") > 30


def test_results_are_written_and_judged(tmp_path: Path) -> None:
    report = module("convert_report")
    path = tmp_path / "convert_speed.json"
    module("common").write_result(path, "convert_speed", example_result())
    check_result(json.loads(path.read_text()))
    ratios = example_result()["ratios"]
    assert report.met("images_of_encoder", ratios["images_of_encoder"]) is True
    assert report.met("images_vs_lerobot", ratios["images_vs_lerobot"]) is True
    assert report.met("states_vs_lerobot", ratios["states_vs_lerobot"]) is False
    assert report.met("lift_quality_vs_official", 0.1) is None
    assert report.met(report.MEMORY_RATIO, ratios[report.MEMORY_RATIO]) is False
    text = report.report(example_result())
    assert re.search(r"images_vs_lerobot +6\.00 +>= 5 +met", text)
    assert re.search(r"lift_vs_official +1\.00 +>= 3 +NOT MET", text)
    assert re.search(r"memory_most_of_fewest +1\.80 +<= 1\.1 +NOT MET", text)
    assert "NOT QUIET" in text


def test_parts_left_out_are_left_out_of_the_report() -> None:
    body, report = example_result(), module("convert_report")
    body["frames_per_second"] = {k: v for k, v in body["frames_per_second"].items() if not k.startswith("lift")}
    body["memory"] = body["commands"] = {}
    body["ratios"] = report.ratios(body["frames_per_second"], body["memory"])
    assert {name for name in report.RATIOS if name.startswith("lift")}.isdisjoint(body["ratios"])
    assert report.MEMORY_RATIO not in body["ratios"]
    text = report.report(body)
    assert "official" not in text
    assert "peak MiB" not in text


def test_sections_are_measured_again(tmp_path: Path) -> None:
    speed, spread = module("convert_sections"), module("common").spread
    before = json.loads(json.dumps(example_result()))
    keys = ("states_ours_1", "states_renderer_1")
    rates = {key: spread([value]) for key, value in zip(keys, (90.0, 100.0), strict=True)}
    body = {**before, "frames_per_second": rates, "cpu_ms_per_step": {}, "dataset_mib": {}, "mode": "full"}
    body["scene_loading"] = {"seconds_per_demo": 0.1, "share_of_drawing": 0.2}
    body["machine"] = before["machine"] | {"cpu": "another", "renderer": "another's"}
    found = speed.merged(before, body, ("states",))
    assert found["ratios"]["states_of_renderer"] == pytest.approx(0.9)
    assert "states_of_renderer_2" not in found["ratios"]
    assert found["frames_per_second"]["images_ours_1"] == before["frames_per_second"]["images_ours_1"]
    assert found["scene_loading"] == body["scene_loading"]
    assert set(found["measured_again"]) == {"states"}
    again = found["measured_again"]["states"]
    assert (again["machine"], again["versions"]) == (body["machine"], body["versions"])
    assert found["machine"] == before["machine"], "which has the other sections"
    assert not {"commands", "startup"} & set(found), "whole commands stand beside the rates of their own run"
    assert found["memory"] == before["memory"]
    assert "Not in the rates" not in module("convert_report").report(found)
    assert "commands" in speed.merged(before, body, ("lift",))
    output = tmp_path / "result.json"
    assert speed.chosen_sections(None, output) == speed.SECTIONS
    with pytest.raises(UserError, match="is missing"):
        speed.chosen_sections("states", output)
    output.write_text("{}")
    assert speed.chosen_sections("states, lift", output) == ("states", "lift")
    with pytest.raises(UserError, match=r"images,decode"):
        speed.chosen_sections("decode", output)
    with pytest.raises(UnknownNameError, match="'states'"):
        speed.chosen_sections("state", output)


@pytest.mark.skipif(not RESULT.exists(), reason="no measured result in this checkout")
def test_stored_result_is_complete() -> None:
    check_result(json.loads(RESULT.read_text(encoding="utf-8")), not_yet=frozenset({"images_lerobot_alike"}))
