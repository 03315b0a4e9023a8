"""The shape of the source tree: who may import whom, nothing happens at import, and files stay readable."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from source_tree import PACKAGE, REPOSITORY, imports

from robocasa_lerobot.cli import SUBCOMMANDS

# What each part of the package may import of the rest of the package. Parts on one level stay apart.
BASE = {
    *("benchmark", "config_files", "contract", "errors", "files", "gl", "hdf5_files", "jobs", "jsonl", "progress"),
    *("provenance", "quiet", "settings", "video", "wilson", "wire"),
}
LOW = {"envs", "convert", "data", "policies"}
MAY_IMPORT: dict[str, set[str]] = {
    "config_files": {"errors"},
    "contract": {"errors"},
    "errors": set(),
    "gl": {"errors"},
    "benchmark": {"errors"},
    "files": set(),
    "hdf5_files": {"files"},
    "jsonl": set(),
    "provenance": set(),
    "progress": set(),
    "quiet": set(),
    "jobs": {"errors", "files", "progress"},
    "settings": {"errors"},
    "video": {"contract", "errors"},
    "wilson": {"errors"},
    "wire": set(),
    **dict.fromkeys(LOW, BASE),
    "convert": BASE | {"envs"},  # its rendering alone: see ONLY_ROOMS
    "demos": BASE | {"envs"},
    "training": BASE | {"data", "policies"},
    "evaluation": BASE | {"envs", "convert", "data", "policies", "demos"},  # demos: a reference policy
    "corrections": BASE | {"envs", "demos", "evaluation"},
    "making": BASE | {"envs", "convert", "data", "demos", "training", "corrections"},  # data that an experiment needs
    "study": BASE | {"data", "training", "evaluation", "making"},
    "gallery": BASE | {"envs", "demos"},
    "serving": BASE | {"envs", "evaluation"},  # policies for others' evaluations, kitchens for others' policies
    "teleop": BASE | {"envs", "demos", "evaluation"},
    "devices": BASE | {"envs", "demos"},  # the kitchen as a LeRobot robot
    "plugins": BASE | LOW | {"demos", "training", "evaluation", "devices"},
    "cli": BASE
    | LOW
    | {"demos", "training", "evaluation", "making", "gallery", "study", "serving", "teleop", "corrections"},
}
# Of these parts, what each room (a folder, or a file beside the folders) may import of the other rooms.
ROOMS: dict[str, dict[str, set[str]]] = {
    "envs": {
        "physics": set(),
        "seeds": set(),
        "kept_files": set(),
        "rendering": {"physics"},
        "robots": {"physics", "rendering"},
        "kitchens": {"physics", "rendering", "kept_files"},
        "objects": {"kitchens", "rendering", "kept_files"},
        "scene": {"physics", "rendering", "robots", "kitchens", "objects", "seeds"},
        "predicates": {"robots", "kitchens", "objects", "scene"},
        "tasks": {"kitchens", "objects", "scene", "predicates"},
    },
}
ONLY_ROOMS = {("convert", "envs"): {"rendering"}}  # what a part may import of another, where that is not all of it
TORCH = {"torch", "torchvision", "lerobot", "accelerate", "transformers", "diffusers", "safetensors"}
PHYSICS = {"mujoco", "gymnasium_robotics"}
FORBIDDEN: dict[str, set[str]] = {
    "config_files": TORCH | PHYSICS,
    "contract": TORCH | PHYSICS,
    "errors": TORCH | PHYSICS,
    "gl": TORCH,
    "benchmark": TORCH | PHYSICS,
    "files": TORCH | PHYSICS,
    "hdf5_files": TORCH | PHYSICS,
    "jsonl": TORCH | PHYSICS,
    "provenance": TORCH | PHYSICS,
    "jobs": TORCH | PHYSICS,
    "progress": TORCH | PHYSICS,
    "quiet": TORCH | PHYSICS,
    "settings": TORCH | PHYSICS,
    "video": TORCH | PHYSICS,
    "wilson": TORCH | PHYSICS,
    "wire": TORCH | PHYSICS,
    "envs": TORCH,
    "demos": TORCH,
    "data": PHYSICS,
    "policies": PHYSICS,
    "training": PHYSICS,
    "convert": PHYSICS,
}
# Single files that may import more than their part, and why.
EXCEPTIONS: dict[str, set[str]] = {
    "envs/lerobot_plugin.py": {"lerobot"},  # the env type that LeRobot's discovery finds
    "convert/scenes/compiled.py": {"mujoco"},  # what "convert/render.py" draws
    "convert/render.py": {"mujoco"},  # pictures of demonstrations that were stored without any
}
MAX_LINES = 400
LONGER_FILES: dict[str, str] = {  # path in the repository: reason
    # Two halves would call each other, and numba keeps machine code on disk by the function's own file alone.
    "robocasa_lerobot/demos/planning/kernel.py": "compiled code in one file",
    "robocasa_lerobot/envs/robots/panda_omron/control/kernel.py": "compiled code in one file",
}
MAX_FILES = 15  # of a folder, `__init__.py` apart
LARGER_FOLDERS = {
    "cli": 24,  # one file for each command
    "envs/objects/forms": 20,  # one file for each family of shapes
    "demos": 18,
    "demos/skills": 23,  # one file for each verb or appliance
}
SCRIPT_LINES = 80
# MuJoCo is not among them: `import robocasa_lerobot.envs` registers the tasks, which takes half a second in all.
HEAVY = {"torch", "lerobot", "datasets", "transformers", "av", "matplotlib"}


def sources() -> list[str]:
    return sorted(path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py"))


def module_name(source: str) -> str:
    parts = source.removesuffix(".py").split("/")
    return ".".join(["robocasa_lerobot", *(parts[:-1] if parts[-1] == "__init__" else parts)])


def part_of(source: str) -> str:
    return source.split("/")[0].removesuffix(".py")


def own_parts(names: frozenset[str]) -> Iterator[tuple[str, str]]:
    """(part, full name) of the imports that stay in the package."""
    for name in names:
        pieces = name.split(".")
        if pieces[0] == "robocasa_lerobot" and len(pieces) > 1 and not pieces[1].startswith("__"):
            yield pieces[1], name


@pytest.mark.parametrize("source", sources())
def test_import_direction(source: str) -> None:
    part = part_of(source)
    if part == "__init__":
        assert not imports(PACKAGE / source)
        return
    assert part in MAY_IMPORT, f"new part {part!r}: give it a place in MAY_IMPORT"
    allowed = MAY_IMPORT[part] | {part}
    wrong = [name for target, name in own_parts(imports(PACKAGE / source)) if target not in allowed]
    assert not wrong, f"{part} may import only {sorted(allowed)}"


def rooms_of(name: str) -> tuple[str, str]:
    """Part and room of a module's name."""
    pieces = [*name.split(".")[1:], "", ""]
    return pieces[0], pieces[1]


@pytest.mark.parametrize("source", sources())
def test_rooms_import_in_their_order(source: str) -> None:
    part, room = rooms_of(module_name(source))
    for name in imports(PACKAGE / source):
        if not name.startswith("robocasa_lerobot."):
            continue
        other_part, other = rooms_of(name)
        if other_part == part and room in ROOMS.get(part, {}):
            assert other in ROOMS[part][room] | {room}, f"{part}/{room} may import only {ROOMS[part][room]}"
        if (part, other_part) in ONLY_ROOMS:
            assert other in ONLY_ROOMS[part, other_part], name


def folder_graph(graph: Mapping[str, set[str]], folder: str) -> dict[str, set[str]]:
    """What the folders and files that lie directly in a folder import of each other."""

    def inside(module: str) -> str:
        return module.removeprefix(folder + ".").split(".")[0] if module.startswith(folder + ".") else ""

    out: dict[str, set[str]] = {}
    for module, others in graph.items():
        if room := inside(module):
            out.setdefault(room, set()).update({inside(other) for other in others} - {"", room})
    return out


def test_folders_import_each_other_in_one_direction() -> None:
    graph = imported_files({module_name(source): PACKAGE / source for source in sources()})
    folders = {module.rpartition(".")[0] for module in graph if "." in module}
    found = {folder: circle(folder_graph(graph, folder)) for folder in folders}
    assert not {folder: names for folder, names in found.items() if names}


def test_a_circle_of_folders_is_found_where_files_have_none() -> None:
    graph = {"p.a.one": {"p.b.one"}, "p.b.one": set[str](), "p.b.two": {"p.a.two"}, "p.a.two": set[str]()}
    assert circle(graph) == []
    assert set(circle(folder_graph(graph, "p"))) == {"a", "b"}


def test_folders_are_readable_at_a_glance() -> None:
    for folder in {path.parent for path in PACKAGE.rglob("*.py")}:
        name = folder.relative_to(PACKAGE).as_posix()
        files = [path.name for path in folder.glob("*.py") if path.name != "__init__.py"]
        assert len(files) <= LARGER_FOLDERS.get(name, MAX_FILES), f"{name} has {len(files)} files: make rooms"


def imported_files(files: Mapping[str, Path]) -> dict[str, set[str]]:
    """For each module the others of `files` that it imports, wherever in it and be it for types alone."""
    graph: dict[str, set[str]] = {}
    for module, path in files.items():
        found = {name if name in files else name.rpartition(".")[0] for name in imports(path)}
        graph[module] = (found & files.keys()) - {module}
    return graph


def circle(graph: Mapping[str, set[str]]) -> list[str]:
    """A circle of modules that import each other; empty where there is none."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_files_import_each_other_in_a_circle() -> None:
    files = {module_name(source): PACKAGE / source for source in sources()}
    files |= {path.stem: path for path in (REPOSITORY / "benchmarks").glob("*.py")}
    assert circle(imported_files(files)) == []


def test_a_circle_is_found_wherever_its_imports_stand(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("def f() -> None:\n    from b import g\n")
    (tmp_path / "b.py").write_text("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import a\n")
    (tmp_path / "c.py").write_text("import a\n")
    files = {path.stem: path for path in tmp_path.glob("*.py")}
    assert set(circle(imported_files(files))) == {"a", "b"}


@pytest.mark.parametrize("source", sources())
def test_parts_know_no_more_than_they_should(source: str) -> None:
    forbidden = FORBIDDEN.get(part_of(source), set()) - EXCEPTIONS.get(source, set())
    wrong = sorted(name for name in imports(PACKAGE / source) if name.split(".")[0] in forbidden)
    assert not wrong


def test_exceptions_are_files_that_exist() -> None:
    assert set(EXCEPTIONS) <= set(sources())
    assert all((REPOSITORY / path).exists() for path in LONGER_FILES)


_IMPORT_ALL = """
import json, os, random, sys
names, preloaded = json.loads(sys.argv[1])
import importlib
for name in preloaded:
    importlib.import_module(name)
import numpy as np
before = dict(os.environ), random.getstate(), repr(np.random.get_state())
print("START")
for name in names:
    importlib.import_module(name)
after = dict(os.environ), random.getstate(), repr(np.random.get_state())
print("END", json.dumps({
    "environment": sorted(k for k in {*before[0], *after[0]} if before[0].get(k) != after[0].get(k)),
    "random": before[1:] != after[1:],
    "loaded": sorted({name.split(".")[0] for name in sys.modules}),
}))
"""


def import_in_new_process(names: list[str], preloaded: tuple[str, ...] = ()) -> dict[str, object]:
    """Import modules in a fresh process; what that changed, and what was loaded. Asserts that nothing was printed."""
    done = subprocess.run(
        [sys.executable, "-c", _IMPORT_ALL, json.dumps([names, preloaded])], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    said, _, report = done.stdout.split("START\n", 1)[1].rpartition("END ")
    assert said == ""
    return dict(json.loads(report))


def modules(*parts: str) -> list[str]:
    return [module_name(s) for s in sources() if part_of(s) in parts and s not in EXCEPTIONS]


def test_envs_and_demos_load_no_torch_and_have_no_import_side_effects() -> None:
    preloaded = ("mujoco", "gymnasium", "datatrove.executor.local")  # they set a variable or draw random numbers
    report = import_in_new_process(modules(*BASE, "envs", "demos"), preloaded)
    assert not TORCH & set(report["loaded"])  # type: ignore[call-overload]
    assert report["environment"] == []
    assert report["random"] is False


def test_learning_side_loads_no_mujoco_and_has_no_import_side_effects() -> None:
    preloaded = ("torch", "torchvision", "lerobot.policies.factory", "lerobot.datasets", "accelerate")
    report = import_in_new_process(modules("data", "policies", "training"), preloaded)
    assert not PHYSICS & set(report["loaded"])  # type: ignore[call-overload]
    assert report["environment"] == []
    assert report["random"] is False


def test_what_only_hands_out_trials_loads_no_simulator() -> None:
    report = import_in_new_process([f"robocasa_lerobot.evaluation.run.{name}" for name in ("engine", "outputs")])
    assert not {"mujoco", "gymnasium", "numba", *TORCH} & set(report["loaded"])  # type: ignore[call-overload]


def test_command_modules_are_light() -> None:
    names = ["robocasa_lerobot.cli", *(subcommand.module for subcommand in SUBCOMMANDS.values())]
    report = import_in_new_process(names, preloaded=("gymnasium",))
    assert not HEAVY & set(report["loaded"])  # type: ignore[call-overload]
    assert report["environment"] == []


@pytest.mark.parametrize("script", ["train.py", "eval.py"])
def test_scripts_are_thin(script: str) -> None:
    assert len((REPOSITORY / script).read_text(encoding="utf-8").splitlines()) < SCRIPT_LINES


def repository_files() -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=REPOSITORY, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [path for name in listed.stdout.split("\0") if name and (path := REPOSITORY / name).is_file()]


def test_files_are_readable_in_one_go() -> None:
    for path in repository_files():
        name = path.relative_to(REPOSITORY).as_posix()
        if path.suffix == ".py" and name not in LONGER_FILES:
            lines = len(path.read_text(encoding="utf-8").splitlines())
            assert lines <= MAX_LINES, f"{name} has {lines} lines: split it, or give a reason in LONGER_FILES"


def test_no_paths_of_one_machine_and_no_download_addresses() -> None:
    machine = re.compile(r"(?:^|[^\w./-])/(?:" + "|".join(["work", "farm", "root"]) + r")/", re.MULTILINE)
    index = re.compile(r"--(?:extra-)?index-url|--find-links|https?://(?:files|pypi)\.")
    for path in repository_files():
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        assert not machine.search(text), f"{path}: {machine.search(text)}"
        if path.name in ("requirements.lock", "pyproject.toml", "Makefile", "run"):
            assert not index.search(text), f"{path}: {index.search(text)}"


def test_facts_that_comments_cite_are_there() -> None:
    page = (REPOSITORY / "docs" / "robocasa.md").read_text(encoding="utf-8")
    there = set(re.findall(r"^## (\d+)\.", page, re.MULTILINE))
    texts = [path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")]
    cited = {number for text in texts for number in re.findall(r"docs/robocasa\.md, section (\d+)", text)}
    assert len(cited) > 5
    assert cited <= there
    assert not [text for text in texts if re.search(r"(?i)robocasa facts|\(facts, section", text)]


def test_every_decision_is_in_the_list() -> None:
    folder = REPOSITORY / "docs" / "decisions"
    pages = {path.name for path in folder.glob("0*.md")}
    text = (folder / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\((0\d+-[^)]*\.md)\)", text)) == pages
    numbers = [int(number) for number in re.findall(r"^\| \[?(\d{4})", text, re.MULTILINE)]
    assert numbers == sorted(set(numbers))
    assert 17 in numbers  # a number that is left out is said to be


def test_only_tests_look_beside_the_checkout() -> None:
    """What lies there is not what users have."""
    files = [path for folder in (PACKAGE, REPOSITORY / "benchmarks") for path in folder.rglob("*.py")]
    files += [REPOSITORY / name for name in ("Makefile", "train.py", "eval.py")] + sorted(REPOSITORY.glob("scripts/*"))
    ours = [path for path in files if ".venvs" not in path.parts]
    looking = [
        path.name
        for path in ours
        if re.search(r'\.\./shared|parents?(\[\d\])? / "shared"', path.read_text(encoding="utf-8"))
    ]
    assert not looking
