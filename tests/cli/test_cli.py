"""The console command: every subcommand helps with an example, and mistakes are answered in one sentence."""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from robocasa_lerobot import __version__, cli
from robocasa_lerobot.config_files import configs_folder
from robocasa_lerobot.errors import UserError

REPOSITORY = Path(__file__).parents[2]


@pytest.mark.parametrize("name", cli.SUBCOMMANDS)
def test_help_shows_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        cli.main([name, "--help"])
    assert exit_.value.code == 0
    shown = capsys.readouterr().out
    assert f"usage: robocasa-lerobot {name}" in shown
    assert "example:" in shown
    assert f"robocasa-lerobot {name}" in shown.split("example:")[1]


@pytest.mark.parametrize("name", cli.SUBCOMMANDS)
def test_help_says_of_each_option_what_it_is_and_its_default(name: str) -> None:
    for option in cli._subparser(cli.build_parser([name]), name)._actions:
        if option.help == argparse.SUPPRESS:
            continue
        assert option.help, f"{option.option_strings or option.dest} has no help"
        if option.option_strings and option.nargs != 0 and option.default not in (None, "", [], (), argparse.SUPPRESS):
            assert "default" in option.help, f"{option.option_strings} does not say its default, {option.default!r}"


def test_help_of_an_evaluation_says_the_defaults_of_its_settings(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["eval", "--help"])
    shown = " ".join(capsys.readouterr().out.split())
    assert "trials of each policy on each task (default: 10)." in shown
    assert "perturbation.names A,B none," in shown
    assert "trials run under each of them (default: none)." in shown
    assert (
        "--report [true|false] write the report at the end: report.html, .md, .tex and two .csv (default: true)."
        in shown
    )


@pytest.mark.parametrize("name", cli.SUBCOMMANDS)
def test_example_parses(name: str) -> None:
    """The example of the help text is a command line that the parser accepts."""
    parser = cli.build_parser([name])
    example = str(sys.modules[cli.SUBCOMMANDS[name].module].EXAMPLE)  # type: ignore[attr-defined]
    for line in example.strip().splitlines():
        words = line.split("#")[0].split()
        assert words[:2] == ["robocasa-lerobot", name]
        args, settings = parser.parse_known_args(words[1:])
        assert callable(args.run)
        assert not settings or args.takes_settings
        assert all(re.match(r"--[\w.]+=", setting) for setting in settings)
        for path in re.findall(r"configs/\S+", line):
            assert (REPOSITORY / path).is_file(), f"{path} of the example does not exist"


def test_a_command_in_another_checkout_says_which_one_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "robocasa_lerobot" / "cli").mkdir(parents=True)
    (tmp_path / "robocasa_lerobot" / "cli" / "__init__.py").touch()
    for folder, told in ((tmp_path, True), (REPOSITORY, False), (tmp_path / "robocasa_lerobot", False)):
        monkeypatch.chdir(folder)
        assert cli.main(["tasks", "OpenDrawer"]) == 0
        said = capsys.readouterr().err
        assert (f"PYTHONPATH={tmp_path}" in said) == told, said


def test_no_command_takes_a_number_of_workers_that_does_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    asked = []
    for name in cli.SUBCOMMANDS:
        parser = cli.build_parser([name])
        example = str(sys.modules[cli.SUBCOMMANDS[name].module].EXAMPLE).splitlines()[0]  # type: ignore[attr-defined]
        words = example.split("#")[0].split()[1:]
        if hasattr(parser.parse_known_args(words)[0], "workers"):
            asked.append(name)
            assert cli.main([*words, "--workers", "0"]) == 2
            assert "--workers is 0, expected at least 1" in capsys.readouterr().err
    assert {"demos", "convert", "replay", "prepare", "gallery", "inspect", "study"} <= set(asked)


def test_no_command_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 0
    shown = capsys.readouterr().out
    for name, subcommand in cli.SUBCOMMANDS.items():
        assert name in shown
        assert subcommand.summary.split()[0] in shown


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_:
        cli.main(["--version"])
    assert exit_.value.code == 0
    assert __version__ in capsys.readouterr().out


@pytest.mark.parametrize(
    ("typed", "meant"), [("convret", "convert"), ("demo", "demos"), ("Doctor", "doctor"), ("evaluate", "eval")]
)
def test_misspelt_command_names_the_closest(typed: str, meant: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([typed]) == 2
    assert f"'{meant}'" in capsys.readouterr().err


def test_users_mistake_is_one_sentence_and_status_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(args: argparse.Namespace) -> int:
        raise UserError("found a cat, expected a dog; call a vet.")

    def configure(parser: argparse.ArgumentParser) -> None:
        parser.add_argument("--animal")

    module = SimpleNamespace(EXAMPLE="robocasa-lerobot vet", configure=configure, run=run)
    monkeypatch.setitem(sys.modules, "a_vet", module)
    monkeypatch.setitem(cli.SUBCOMMANDS, "vet", cli.Subcommand("a_vet", "look after animals"))
    assert cli.main(["vet", "--animal", "cat"]) == 2
    printed = capsys.readouterr()
    assert printed.err == "robocasa-lerobot vet: found a cat, expected a dog; call a vet.\n"
    assert printed.out == ""


@pytest.mark.parametrize("name", cli.SUBCOMMANDS)
def test_processes_are_as_many_as_the_cores_that_this_one_may_use(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(3)), raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 96)
    parser = cli.build_parser([name])
    example = str(sys.modules[cli.SUBCOMMANDS[name].module].EXAMPLE).strip().splitlines()[0]  # type: ignore[attr-defined]
    args, _ = parser.parse_known_args(example.split("#")[0].split()[1:])
    assert getattr(args, "workers", None) in (None, 3)  # None: chosen later


def test_so_are_those_of_a_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def record_tasks(*_: Any, workers: int, **__: Any) -> None:
        asked.append(workers)
        raise UserError("this far")

    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(3)), raising=False)
    monkeypatch.setattr("robocasa_lerobot.demos.recording.record_tasks", record_tasks)
    assert cli.main(["demos", "--tasks", "CloseDrawer", "--out", str(tmp_path)]) == 2
    assert asked == [3]


def test_console_script_is_installed() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "robocasa_lerobot.cli", "--version"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, f"robocasa-lerobot {__version__}\n")


def test_a_path_that_cannot_be_used_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(args: argparse.Namespace) -> int:
        (tmp_path / "no folder" / "file").write_text("")
        return 0

    module = SimpleNamespace(EXAMPLE="robocasa-lerobot vet", configure=lambda _: None, run=run)
    monkeypatch.setitem(sys.modules, "a_vet", module)
    monkeypatch.setitem(cli.SUBCOMMANDS, "vet", cli.Subcommand("a_vet", "look after animals"))
    assert cli.main(["vet"]) == 2
    path = tmp_path / "no folder/file"
    assert capsys.readouterr().err == f"robocasa-lerobot vet: {path}: No such file or directory.\n"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["data", "--convert", ".", "--out=elsewhere"], "unrecognized arguments: --out=elsewhere"),
        (["data", "small/foundation.yaml", "--to", "elsewhere"], "--to is for --convert"),
        (["data", "small/foundation.yaml", "--replace"], "are for --make"),
        (["serve", "--policy.path=openpi://localhost:8000"], "is served already"),
        (["tasks", "--markdown", "a.md", "--deviations", "b.md"], "one of them at a time"),
    ],
)
def test_what_would_be_left_out_without_a_word_is_told(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(words) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", cli.SUBCOMMANDS)
def test_options_of_an_executor_that_is_not_asked_for_are_told(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Instead of hours of work on a login node."""
    monkeypatch.chdir(tmp_path)
    parser = cli.build_parser([name])
    example = str(sys.modules[cli.SUBCOMMANDS[name].module].EXAMPLE).strip().splitlines()[0]  # type: ignore[attr-defined]
    words = example.split("#")[0].split()[1:]
    if not hasattr(parser.parse_known_args(words)[0], "executor"):
        return
    assert cli.main([*words, "--slurm.partition", "gpu"]) == 2
    assert (
        "--slurm.partition is for --executor slurm, and the command would run on this machine"
        in capsys.readouterr().err
    )
    assert cli.main([*words, "--executor", "slurm", "--ray.cpus=4"]) == 2
    assert "--ray.cpus is for --executor ray, and the command would run on Slurm" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_misspelt_options_are_told_with_the_closest(capsys: pytest.CaptureFixture[str]) -> None:
    """Also where argparse would miss what was meant by it; hyphens and underscores are the same."""
    assert cli.main(["demos", "--task=OpenDrawer", "--out=x"]) == 2
    assert "robocasa-lerobot demos: unknown option '--task'. Did you mean '--tasks'" in capsys.readouterr().err
    assert cli.main(["study", "--plan", "--at-once=0"]) == 2
    assert "--at_once is 0" in capsys.readouterr().err
    assert cli.main(["eval", "--env.task=OpenDrawer", "--policy=zero"]) == 2
    assert "unknown setting 'env.task'. Did you mean 'env.tasks'" in capsys.readouterr().err
    assert cli.main(["eval", "--env.tasks=OpenDrawer", "--policy=zero", "--check", "--shard=5/4"]) == 2
    assert "expected I/N" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("rndom", "Did you mean 'random'?"),
        ("Demonstrator", "Did you mean 'demonstrator'?"),
        ("replai:demo.hdf5", "Did you mean 'replay:FILE'?"),
        ("opnpi://127.0.0.1:8000", "Did you mean 'openpi'?"),
    ],
)
def test_misspelt_policies_are_told_before_anything_runs(
    given: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where no checkpoint is needed yet as well; a folder that a training will write may be named there."""
    monkeypatch.chdir(tmp_path)
    check = ["eval", "--env.tasks=OpenDrawer", "--check"]
    assert cli.main([*check, f"--policy={given}"]) == 2
    assert said in capsys.readouterr().err
    if "://" not in given:
        assert cli.main(["correct", f"--policy={given}", "--tasks=OpenDrawer", "--out=x"]) == 2
        assert said in capsys.readouterr().err
    for path in ("outputs/random", "pretrained_model", "zero"):
        assert cli.main([*check, f"--policy={path}"]) == 0


@pytest.mark.parametrize(
    ("policies", "said"),
    [
        (["--policy=zero,zero"], "two policies are called 'zero'"),
        (["--policy=zero,random", "--policy.label=a/b,a__b"], "would have one folder"),
        (["--policy=zero", "--policy.label=.hidden"], "no leading '.'"),
        (["--policy=replay:"], "with a colon at its end"),
        (["--policy=zero", "--policy.label=a: b"], "is written in quotes"),
    ],
)
def test_check_tells_of_labels_what_a_run_would(
    policies: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["eval", "--env.tasks=OpenDrawer", "--check", *policies]) == 2
    assert said in capsys.readouterr().err


def test_check_says_which_policies_are_not_there_yet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No mistake, as a training may be about to write them; but nothing that a person wants to find out later."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    there = "zero,demonstrator,openpi://127.0.0.1:8000"
    assert cli.main(["eval", "--env.tasks=OpenDrawer", "--check", f"--policy=demo,empty,replay:a.hdf5,{there}"]) == 0
    said = [line for line in capsys.readouterr().out.splitlines() if line.startswith("not there yet: ")]
    assert [line.split(";")[0].removeprefix("not there yet: policy.path ") for line in said] == [
        "demo: no such folder",
        "empty: has no config.json",
        "replay:a.hdf5: no such file or folder",
    ]


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("policies/act.yaml", "with `type` it is a policy's settings"),
        ("evaluations/quick.yaml", "with `trials` it is an evaluation"),
        ("mixtures/demo_pretrain.yaml", "with `members` it is a mixture"),
        ("study.yaml", "with `parts` it is a study"),
    ],
)
def test_a_file_of_another_kind_is_told(file: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["train", f"--config_path={configs_folder() / file}"]) == 2
    assert words in capsys.readouterr().err
