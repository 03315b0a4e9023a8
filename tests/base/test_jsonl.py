"""JSON lines hold every text, and every path that a file system takes."""

from __future__ import annotations

import os
from pathlib import Path

from full_disk import full_after

from robocasa_lerobot.jsonl import read_jsonl, read_whole_lines, write_jsonl


def test_a_path_that_is_no_utf_8_is_written_and_read_back(tmp_path: Path) -> None:
    odd = os.fsdecode(b"/data/caf\xe9.hdf5")
    lines = [{"instruction": "Öffne 引き出し"}, {"source_file": odd, "reason": "Öffne"}]
    write_jsonl(tmp_path / "a.jsonl", lines)
    assert read_jsonl(tmp_path / "a.jsonl") == lines
    first, second, _ = (tmp_path / "a.jsonl").read_text(encoding="utf-8").split("\n")
    assert "引き出し" in first  # to be read by people
    assert second.isascii()


def test_a_line_that_was_cut_off_goes_and_the_whole_ones_are_not_written_again(tmp_path: Path) -> None:
    file = tmp_path / "log.jsonl"
    lines = [{"task": "OpenDrawer"}, {"task": "引き出し"}]
    write_jsonl(file, lines)
    whole = file.read_bytes()
    file.write_bytes(whole + b'{"task": "Clo')
    with full_after(1):
        assert read_whole_lines(file) == lines
    assert file.read_bytes() == whole
    assert read_whole_lines(file) == lines
    assert read_whole_lines(tmp_path / "none.jsonl") == []
