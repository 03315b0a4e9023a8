"""Bad and hostile input, unwritable outputs: a clear message, the rest goes on, never half a dataset."""

from __future__ import annotations

import errno
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from convert_support import INSTRUCTION, leftovers, write_demos
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.reading import hdf5
from robocasa_lerobot.convert.reading.safe_scan import CPU_SECONDS
from robocasa_lerobot.convert.record_files import ACTIONS_OUT_OF_RANGE, CONVERSION_FILE, META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings, make_plan
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

SETTINGS = ConversionSettings()
STEPS = 6
CAMERA = f"obs/{contract.CAMERAS[0]}_image"

# --- episodes: rejected with a reason, beside good ones -------------------------------------------------------------


def _replaced(key: str, make: Callable[[h5py.Group], Any]) -> Callable[[h5py.Group], None]:
    def spoil(demo: h5py.Group) -> None:
        values = make(demo)
        del demo[key]
        demo[key] = values

    return spoil


def _elsewhere(demo: h5py.Group) -> Path:
    return Path(demo.file.filename).with_name("elsewhere.hdf5")


def _external_link(demo: h5py.Group) -> h5py.ExternalLink:
    with h5py.File(_elsewhere(demo), "w") as other:
        other["actions"] = np.zeros((STEPS, contract.ACTION_SIZE))
    return h5py.ExternalLink(_elsewhere(demo).name, "/actions")


def _soft_to_external(demo: h5py.Group) -> h5py.SoftLink:
    demo["aside"] = h5py.ExternalLink(_elsewhere(demo).name, "/actions")
    return h5py.SoftLink(f"{demo.name}/aside")


def _external_data(demo: h5py.Group) -> None:
    secret = Path(demo.file.filename).with_name("secret.bin")
    secret.write_bytes(b"s" * STEPS * 16 * 16 * 3)
    del demo[CAMERA]
    demo.create_dataset(CAMERA, (STEPS, 16, 16, 3), "u1", external=[(str(secret), 0, h5py.h5f.UNLIMITED)])


def _virtual(demo: h5py.Group) -> None:
    layout = h5py.VirtualLayout((STEPS, contract.ACTION_SIZE), "f8")
    layout[:] = h5py.VirtualSource(_elsewhere(demo).name, "actions", (STEPS, contract.ACTION_SIZE))
    del demo["actions"]
    demo.create_virtual_dataset("actions", layout)


def _never_written(demo: h5py.Group) -> None:
    del demo["actions"]
    demo.create_dataset("actions", (STEPS, contract.ACTION_SIZE), "f8")


def _part_missing(demo: h5py.Group) -> None:
    values = demo[CAMERA][:]
    del demo[CAMERA]
    dataset = demo.create_dataset(CAMERA, values.shape, "u1", chunks=(2, *values.shape[1:]), compression="gzip")
    dataset[:2] = values[:2]
    dataset[4:] = values[4:]


def _absurd_pictures(demo: h5py.Group) -> None:
    del demo[CAMERA]
    demo.create_dataset(CAMERA, (STEPS, 100_000, 100_000, 3), "u1", chunks=(1, 64, 64, 3))


def _absurd_chunks(demo: h5py.Group) -> None:
    del demo["actions"]
    demo.create_dataset("actions", (STEPS, contract.ACTION_SIZE), "f8", chunks=(2**24, 12), maxshape=(None, 12))


def _attribute(name: str, value: Any) -> Callable[[h5py.Group], None]:
    return lambda demo: demo.attrs.__setitem__(name, value)


def _long_text(demo: h5py.Group) -> None:
    demo.attrs.create("ep_meta", "x" * 40_000_000, dtype=h5py.string_dtype())


def _huge_attribute(demo: h5py.Group) -> None:
    """100 MB in one attribute, stored densely, which older formats cannot."""
    demo.attrs.create("ep_meta", np.zeros(100_000_000, "u1"))


EPISODES: dict[str, tuple[Callable[[h5py.Group], None], str]] = {
    "link to another file": (_replaced("actions", _external_link), "link to another file"),
    "link to a link to another file": (_replaced("actions", _soft_to_external), "link to another file"),
    "link in a circle": (_replaced("actions", lambda d: h5py.SoftLink(f"{d.name}/actions")), "circle"),
    "link to nowhere": (_replaced("actions", lambda d: h5py.SoftLink("/nowhere")), "not in the file"),
    "data of another file": (_external_data, "other files"),
    "virtual data": (_virtual, "other files"),
    "never written": (_never_written, "never written"),
    "part missing": (_part_missing, "1 of 3 parts are missing"),
    "absurd pictures": (_absurd_pictures, "missing"),
    "absurd chunks": (_absurd_chunks, "in chunks of"),
    "complex numbers": (_replaced("actions", lambda d: d["actions"][:] + 1j), "numbers"),
    "a group for numbers": (lambda d: (d.__delitem__("actions"), d.create_group("actions")), "no dataset"),  # type: ignore[dict-item]
    "half characters": (_attribute("ep_meta", '{"lang": "\\ud800"}'), "ep_meta"),
    "endless nesting": (_attribute("ep_meta", "[" * 50_000), "not JSON"),
    "endless number": (_attribute("ep_meta", '{"lang": ' + "9" * 10_000 + "}"), "not JSON"),
    "wrong bytes": (_attribute("ep_meta", b'{"lang": "\xff\xfe"}'), "cannot be read"),
    "not an object": (_attribute("ep_meta", "[1]"), "expected an object"),
    "wrong bytes in the scene": (_attribute("model_file", b"<mujoco>\xff\xfe</mujoco>"), "cannot be read"),
    "text without end": (_long_text, "no demonstration"),
    "attribute of 100 MB": (_huge_attribute, "100000000 bytes"),
}


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset from a file of every kind of bad demo, the good one last; in the newer format, for large attributes."""
    folder = tmp_path_factory.mktemp("bad")
    plain = write_demos(folder / "plain.hdf5", [STEPS] * (1 + len(EPISODES)), images=16)
    source = folder / "demos.hdf5"
    with h5py.File(plain) as old, h5py.File(source, "w", libver="latest") as file:
        file.create_group("data").attrs.update(old["data"].attrs)
        for name in old["data"]:
            group = file["data"].create_group(name)
            group.attrs.update(old["data"][name].attrs)
            for key in old["data"][name]:
                old.copy(f"data/{name}/{key}", group)
        for index, (spoil, _) in enumerate(EPISODES.values()):
            spoil(file[f"data/demo_{index}"])
    convert([source], folder / "data", SETTINGS)
    return folder / "data"


def test_the_good_demo_is_converted(spoilt: Path) -> None:
    report = verify(spoilt, pictures_per_episode=2, min_psnr_db=15)
    assert report.passed, report.as_json()
    assert (report.num_episodes, report.num_frames) == (1, STEPS)


@pytest.mark.parametrize("case", EPISODES)
def test_bad_demo_is_rejected_with_its_reason(case: str, spoilt: Path) -> None:
    lines = {line["source_demo"]: line["reason"] for line in read_jsonl(spoilt / META_FOLDER / "rejected.jsonl")}
    assert len(lines) == len(EPISODES)
    assert EPISODES[case][1] in lines[f"demo_{list(EPISODES).index(case)}"]


# --- the same demo twice ---------------------------------------------------------------------------------------------


def _hard(data: h5py.Group) -> None:
    data["demo_7"] = data["demo_0"]


def _soft(data: h5py.Group) -> None:
    data["demo_7"] = h5py.SoftLink("/data/demo_0")


def _copied(data: h5py.Group) -> None:
    data.copy("demo_0", "demo_7")


def _same_number(data: h5py.Group) -> None:
    data.copy("demo_0", "demo_00")


@pytest.mark.parametrize("twice", [_hard, _soft, _copied, _same_number])
def test_a_demo_that_is_there_twice_is_taken_once(twice: Callable[[h5py.Group], None], tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5, 4), images=16)
    with h5py.File(source, "a") as file:
        twice(file["data"])
    result = convert([source], tmp_path / "out", SETTINGS)
    assert result.num_frames == 9
    assert len(result.rejected) == 1
    assert "copy of demo_0" in result.rejected[0]["reason"]
    assert verify(tmp_path / "out", min_psnr_db=15).passed


def test_a_demo_of_two_files_is_taken_once_and_two_renderings_of_it_twice(tmp_path: Path) -> None:
    first = write_demos(tmp_path / "a.hdf5", (5, 4), images=16)
    second = write_demos(tmp_path / "b.hdf5", (5, 4), images=16)
    with h5py.File(second, "a") as file:
        file[f"data/demo_1/{CAMERA}"][0] = 7  # the same motion seen with another texture is another demonstration
    result = convert([first, second], tmp_path / "out", SETTINGS)
    assert result.num_frames == 5 + 4 + 4
    assert [(line["source_file"], line["source_demo"]) for line in result.rejected] == [(str(second), "demo_0")]
    assert f"copy of demo_0 of {first}" in result.rejected[0]["reason"]


def test_a_copy_of_a_demo_that_is_not_selected_is_taken(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5, 4), images=16)
    with h5py.File(source, "a") as file:
        file["data"].copy("demo_0", "demo_2")
        file["mask/late"] = np.array([b"demo_1", b"demo_2"])
    result = convert([source], tmp_path / "out", ConversionSettings(filter_key="late"))
    assert (result.num_frames, result.rejected) == (9, [])


# --- instructions ----------------------------------------------------------------------------------------------------

INSTRUCTIONS = [
    INSTRUCTION,
    "abre el cajón",
    "e\u0301 is not \u00e9",  # the same to the eye; neither is changed into the other
    "два\u2028строки",  # line separators that Python's splitlines knows and JSON lines do not
    "next\x85line",
    " spaces are kept ",
    '"quoted" \\ and a\ttab',
    "🥄→🍽️",
    "عبئ الغسالة",
]


def test_instructions_of_every_script_are_kept_exactly(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", [2] * len(INSTRUCTIONS), images=16)
    with h5py.File(source, "a") as file:
        for index, text in enumerate(INSTRUCTIONS):
            file[f"data/demo_{index}"].attrs["ep_meta"] = json.dumps({"lang": text}, ensure_ascii=index % 2 == 0)
    convert([source], tmp_path / "out", SETTINGS)
    lines = read_jsonl(tmp_path / "out" / META_FOLDER / "episodes.jsonl")
    assert [line["instruction"] for line in lines] == INSTRUCTIONS
    dataset = LeRobotDataset("local/x", root=tmp_path / "out", video_backend="pyav")
    assert [dataset[2 * index]["task"] for index in range(len(INSTRUCTIONS))] == INSTRUCTIONS
    assert verify(tmp_path / "out", min_psnr_db=15).passed


# --- whole files -----------------------------------------------------------------------------------------------------


def test_a_file_that_another_process_writes_is_locked(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16)
    script = f"import h5py; f = h5py.File({str(source)!r}, 'a'); print('open', flush=True); input()"
    with subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"open\n"
        with pytest.raises(UserError, match="locked"):
            convert([source], tmp_path / "out", SETTINGS)
        writer.communicate(b"\n")
    assert leftovers(tmp_path / "out") == []
    assert convert([source], tmp_path / "out", SETTINGS).num_frames == 5


def test_robot_and_cameras_are_judged_by_a_good_demo(tmp_path: Path) -> None:
    """Not by the first one: here it has another robot's actions, and the second one no camera."""
    source = write_demos(tmp_path / "a.hdf5", (5, 4, 3), images=16)
    with h5py.File(source, "a") as file:
        actions = file["data/demo_0/actions"][:, :7]
        del file["data/demo_0/actions"], file[f"data/demo_1/{CAMERA}"]
        del file["data/demo_1"].attrs["model_file"]
        file["data/demo_0/actions"] = actions
    result = convert([source], tmp_path / "out", SETTINGS)
    assert {line["source_demo"]: line["reason"][:30] for line in result.rejected}.keys() == {"demo_0", "demo_1"}
    assert result.num_frames == 3


def test_large_and_damaged_attributes_of_the_file_are_left_out_of_the_record(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16)
    with h5py.File(source, "a") as file:
        file["data"].attrs.create("notes", "x" * 5_000_000, dtype=h5py.string_dtype())
        file["data"].attrs["bytes"] = b"\xff\xfe"
        file["data"].attrs["env_args"] = "[" * 50_000
    convert([source], tmp_path / "out", SETTINGS)
    record = (tmp_path / "out" / META_FOLDER / "conversion.json").read_text()
    assert len(record) < 200_000
    assert hdf5.LEFT_OUT in record
    assert "5000000" in record


def test_a_rate_beyond_all_bounds_is_refused(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16)
    for rate in ("1e400", "-20", '"20"', "1e9", "NaN"):
        with h5py.File(source, "a") as file:
            file["data"].attrs["env_args"] = '{"env_kwargs": {"control_freq": ' + rate + "}}"
        with pytest.raises(UserError, match="control rate"):
            make_plan([source], SETTINGS)


def _trap(path: Path) -> None:
    """Zero the heap that holds a variable-length text: HDF5 2.0 then looks for it forever."""
    content = bytearray(path.read_bytes())
    start = content.rfind(b"GCOL")
    content[start + 16 : start + 4096] = bytes(len(content[start + 16 : start + 4096]))
    path.write_bytes(content)


def test_a_file_that_traps_hdf5_ends(tmp_path: Path) -> None:
    source = tmp_path / "a.hdf5"
    with h5py.File(write_demos(tmp_path / "plain.hdf5", (3, 4), images=16)) as old, h5py.File(source, "w") as file:
        old.copy("data/demo_0", file, "data/demo_0")
        file["data"].attrs.update(old["data"].attrs)
        file.flush()
        old.copy("data/demo_1", file, "data/demo_1")
        file["data/demo_1"].attrs["note"] = "y" * 5000  # in a heap of its own, the last one
    _trap(source)
    result = convert([source], tmp_path / "out", SETTINGS)
    assert result.num_frames == 3
    reasons = {line["source_demo"]: line["reason"] for line in result.rejected}
    assert reasons.keys() == {"demo_1"}, "this file no longer traps HDF5: find another one"
    assert f"not coming to an end in {CPU_SECONDS:g} s" in reasons["demo_1"]


def test_groups_that_are_not_named_as_episodes_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_demos(tmp_path / "demos.hdf5", (5, 4, 6), images=32)
    with h5py.File(source, "a") as file:
        file.move("data/demo_1", "data/Demo_1")
        file["data/elsewhere"] = h5py.ExternalLink("other.hdf5", "/data/demo_0")
        file["data/note"] = "not a group"
        file.move("assets", "data/assets")  # where earlier versions kept them
    out = tmp_path / "data"
    assert cli.main(["convert", str(source), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    rejected = {line["source_demo"]: line["reason"] for line in read_jsonl(out / META_FOLDER / "rejected.jsonl")}
    assert rejected.keys() == {"Demo_1", "elsewhere"}
    assert "demo_<number>" in rejected["Demo_1"]
    assert "another file" in rejected["elsewhere"]
    assert "2 episodes rejected" in printed
    assert "Demo_1" in printed
    assert verify(out).passed
    assert not convert([source], tmp_path / "chosen", ConversionSettings(demos="demo_0")).rejected  # not asked for
    with h5py.File(source, "a") as file:
        del file["data/demo_0"], file["data/demo_2"]
    with pytest.raises(UserError, match=r"no demos \(groups data/demo_<i>; found: Demo_1, assets"):
        convert([source], tmp_path / "none", SETTINGS)


def test_actions_beyond_the_controllers_range_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_demos(tmp_path / "demos.hdf5", (10, 10), images=32)
    with h5py.File(source, "a") as file:
        file["data/demo_0/actions"][2:5, 1] = -30.0
        file["data/demo_1/actions"][0, 4] = 1.02  # noise
    for name, steps in (("both", 3), ("one", 0)):
        out = tmp_path / name
        demos = [] if name == "both" else ["--demos", "demo_1"]
        assert cli.main(["convert", str(source), "--out", str(out), *demos]) == 0
        printed = capsys.readouterr().out
        found = json.loads((out / META_FOLDER / CONVERSION_FILE).read_text())[ACTIONS_OUT_OF_RANGE]
        assert found["steps"] == steps
        assert ("warning: 15.0% of the steps (3)" in printed) == (steps > 0)
        assert verify(out).passed
    found = json.loads((tmp_path / "both" / META_FOLDER / CONVERSION_FILE).read_text())[ACTIONS_OUT_OF_RANGE]
    assert (found["share"], found["largest"], found["component"]) == (0.15, 30.0, "eef_dy")


def test_a_file_system_that_fails_rejects_no_episode(tmp_path: Path) -> None:
    """What h5py says of a server that is away; the episodes may be good."""
    away = OSError("Can't synchronously read data (file read failed: errno = 5, error message = 'Input/output error')")
    with pytest.raises(UserError, match="give the same command again") as caught, hdf5.reading("'actions'"):
        raise away
    assert not isinstance(caught.value, hdf5.RejectedEpisodeError)
    with pytest.raises(UserError, match="give the same command again"), hdf5.reading("'actions'"):
        raise OSError(errno.ESTALE, "Stale file handle")
    with pytest.raises(hdf5.RejectedEpisodeError), hdf5.reading("'actions'"):
        raise OSError("Can't synchronously read data (inflate() failed)")
