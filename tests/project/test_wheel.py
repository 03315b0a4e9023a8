"""A wheel installed away from the checkout: its configuration files are found by name, and experiments run by them."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest
from source_tree import PACKAGE, REPOSITORY

from robocasa_lerobot.config_files import config_names, configs_folder, find_config
from robocasa_lerobot.errors import UserError


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel as it is published, built from a copy so that nothing is left in the checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=REPOSITORY, capture_output=True, text=True, check=True,
    )  # fmt: skip
    source = folder / "source"
    for name in filter(None, listed.stdout.split("\0")):
        if name.startswith(("tests/", "benchmarks/")) or not (REPOSITORY / name).is_file():
            continue
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_bytes((REPOSITORY / name).read_bytes())
    command = [sys.executable, "-m", "uv", "build", "--wheel", "--no-build-isolation", "--offline", "--quiet"]
    subprocess.run([*command, "--out-dir", str(folder / "dist"), str(source)], check=True)
    (built,) = (folder / "dist").glob("*.whl")
    return built


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python of its own that has the wheel, and only for what it depends on this environment's packages."""
    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(packages)
    ours = next(Path(path) for path in sys.path if path.endswith("site-packages"))
    (packages / "dependencies.pth").write_text(f"{ours}\n")
    return folder / "bin" / "python"


def run(python: Path, *arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.run(
        [str(python), *arguments], cwd=folder, capture_output=True, text=True, env=environment, check=False
    )


def test_a_wheel_has_every_file_of_the_package_and_its_configurations(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        inside = set(archive.namelist())
    ours = {path.relative_to(PACKAGE.parent).as_posix() for path in PACKAGE.rglob("*") if path.is_file()}
    assert {name for name in ours if "__pycache__" not in name and not name.endswith(".md")} <= inside
    configs = {
        f"robocasa_lerobot/{p.relative_to(REPOSITORY).as_posix()}" for p in (REPOSITORY / "configs").rglob("*.*")
    }
    assert configs <= inside
    assert len(configs) > 80


@pytest.mark.slow
def test_train_and_eval_run_by_name_away_from_the_checkout(python: Path, tmp_path: Path) -> None:
    found = run(python, "-c", "import robocasa_lerobot; print(robocasa_lerobot.__file__)", folder=tmp_path)
    assert str(python.parents[1]) in found.stdout, found.stderr
    command = ("-m", "robocasa_lerobot.cli")
    evaluation = "quick --env.tasks=OpenDrawer --trials=1 --env.horizon=2 --workers=1 --videos=0"
    settings = ("--output_dir=out", f"--phases.finetune.evaluations=[{evaluation!r}]", "--evaluate")
    trained = run(python, *command, "train", "--config_path", "configs/debug.yaml", *settings, folder=tmp_path)
    assert trained.returncode == 0, trained.stderr
    assert list((tmp_path / "out").rglob("trials.jsonl"))
    planned = run(python, *command, "train", "--config_path", "demo", "--scale=tiny", "--print_config", folder=tmp_path)
    assert planned.returncode == 0, planned.stderr
    arguments = ("--policy=zero", "--env.tasks=OpenDrawer", "--trials=1", "--env.horizon=2", "--out=trials")
    tried = run(python, *command, "eval", "--config_path", "quick", *arguments, folder=tmp_path)
    assert tried.returncode == 0, tried.stderr
    assert (tmp_path / "trials" / "trials.jsonl").is_file()


@pytest.mark.parametrize("kind", ["experiments", "evaluations", "mixtures", "policies", "scales"])
def test_every_configuration_is_found_by_its_name(kind: str) -> None:
    names = config_names(kind)
    assert names
    for name in names:
        path = configs_folder() / kind / f"{name}.yaml"
        assert find_config(name, kind) == find_config(f"configs/{kind}/{name}.yaml", kind).resolve() == path


def test_a_misspelt_name_is_answered_with_the_closest() -> None:
    with pytest.raises(UserError, match="small/foundation"):
        find_config("small/fundation", "experiments")
    with pytest.raises(UserError, match=r"demo\.yaml"):
        find_config(configs_folder() / "experiments" / "dema.yaml", "experiments")


def test_a_file_of_the_user_wins_over_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tiny").write_text("steps: 1\n")
    monkeypatch.chdir(tmp_path)
    assert find_config("tiny", "scales") == Path("tiny")
