"""JSON lines hold every text, and every path that a file system takes."""

from __future__ import annotations

import os
from pathlib import Path

from robocasa_lerobot.jsonl import read_jsonl, write_jsonl


def test_a_path_that_is_no_utf_8_is_written_and_read_back(tmp_path: Path) -> None:
    odd = os.fsdecode(b"/data/caf\xe9.hdf5")
    lines = [{"instruction": "Öffne 引き出し"}, {"source_file": odd, "reason": "Öffne"}]
    write_jsonl(tmp_path / "a.jsonl", lines)
    assert read_jsonl(tmp_path / "a.jsonl") == lines
    first, second, _ = (tmp_path / "a.jsonl").read_text(encoding="utf-8").split("\n")
    assert "引き出し" in first  # to be read by people
    assert second.isascii()
