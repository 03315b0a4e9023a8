"""What a demonstrator's trials depend on, as a hash: the task's declaration, and the code of the skills it names.

Comments, docstrings and formatting do not count. Kitchens, objects and physics are not in it: after a change there,
the trials of all tasks are to be made again with `--fresh`.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import hashlib
import inspect
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import robocasa_lerobot
from robocasa_lerobot.demos import recorder
from robocasa_lerobot.demos.skills import SKILLS
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.typical import stages_of

PACKAGE = Path(robocasa_lerobot.__file__).parent
DEMOS, REGISTRY = "robocasa_lerobot.demos", "robocasa_lerobot.demos.skills"


@functools.cache
def sources_of(name: str) -> str:
    """The first 16 hexadecimal digits of a SHA-256 over all that trials of a task depend on."""
    task = get_task(name)
    starts = {recorder.__name__, *(SKILLS[stage.skill, stage.verb].__module__ for stage in stages_of(task))}
    parts = [_canonical(task), *(f"{name}:{_code(name)}" for name in sorted(_closure(starts)))]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def _canonical(value: Any) -> str:
    """A declaration as text that depends on what it says alone; functions by their code and what they enclose."""
    if isinstance(value, str | int | float | bool | None):
        return repr(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = ",".join(f"{f.name}={_canonical(getattr(value, f.name))}" for f in dataclasses.fields(value))
        return f"{type(value).__name__}({fields})"
    if isinstance(value, Mapping):
        return "{" + ",".join(sorted(f"{_canonical(k)}:{_canonical(v)}" for k, v in value.items())) + "}"
    if isinstance(value, set | frozenset):
        return "{" + ",".join(sorted(map(_canonical, value))) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(map(_canonical, value)) + "]"
    if isinstance(value, functools.partial):
        return f"partial({_canonical(value.func)},{_canonical(value.args)},{_canonical(value.keywords)})"
    if inspect.isfunction(value):
        enclosed = [cell.cell_contents for cell in value.__closure__ or ()]
        return f"{value.__qualname__}({_bare(textwrap.dedent(inspect.getsource(value)))},{_canonical(enclosed)})"
    if isinstance(value, type):
        return value.__qualname__
    if hasattr(value, "__dict__"):
        return f"{type(value).__name__}({_canonical(vars(value))})"
    return repr(value)


def _closure(starts: Iterable[str]) -> set[str]:
    """The modules of `demos` that these import, and those that they import; but for the list of all skills."""
    found: set[str] = set()
    waiting = list(starts)
    while waiting:
        name = waiting.pop()
        if name in found or name == REGISTRY or _file(name) is None:
            continue
        found.add(name)
        waiting += [other for other in _imports(name) if other.startswith(DEMOS)]
    return found


def _file(module: str) -> Path | None:
    path = PACKAGE.parent / Path(*module.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((file for file in candidates if file.is_file()), None)


@functools.cache
def _tree(module: str) -> ast.Module:
    file = _file(module)
    assert file is not None
    return ast.parse(file.read_text(encoding="utf-8"))


def _imports(module: str) -> Iterator[str]:
    for node in ast.walk(_tree(module)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@functools.cache
def _code(module: str) -> str:
    return _bare(ast.unparse(_tree(module)))


def _bare(source: str) -> str:
    """Code without docstrings, comments and formatting; as it stands where it is no whole statement."""
    try:
        tree = ast.parse(source)
    except SyntaxError:  # a lambda within an expression: its line is what there is
        return " ".join(source.split())
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree)
