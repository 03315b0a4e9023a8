"""JSON text, and files with one JSON object on each line."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any


def json_text(value: Any, indent: int | None = None, default: Callable[[Any], Any] | None = None) -> str:
    """JSON in characters of any script; in ASCII where a text, such as a path that is no UTF-8, cannot be written."""
    text = json.dumps(value, indent=indent, default=default, ensure_ascii=False)
    try:
        text.encode()
    except UnicodeEncodeError:
        return json.dumps(value, indent=indent, default=default)
    return text


def write_jsonl(path: Path, lines: Iterable[dict[str, Any]]) -> None:
    """Write one JSON object on each line."""
    path.write_text("".join(json_text(line) + "\n" for line in lines), encoding="utf-8")


def read_jsonl(path: Path) -> list[dict[str, Any]]:
    """The JSON objects of a file with one on each line."""
    # Not `splitlines`, which also breaks at other characters that instructions may hold.
    return [json.loads(line) for line in path.read_text(encoding="utf-8").split("\n") if line.strip()]


def read_whole_lines(path: Path) -> list[dict[str, Any]]:
    """The JSON objects of a file that grows line by line; none where there is no file.

    A last line that a kill has cut off is removed, so that what is appended next stands on a line of its own.
    """
    if not path.exists():
        return []
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if len(whole) < len(content):
        os.truncate(path, len(whole))  # nothing is written again: a kill or a full disk loses no whole line
    return [json.loads(line) for line in whole.decode("utf-8").split("\n") if line]
