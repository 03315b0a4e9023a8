"""Sections of the conversion benchmark that are measured again, and put into an earlier result."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import convert_report

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.provenance import utc_now

SECTIONS = tuple(convert_report.SECTIONS)


def chosen_sections(only: str | None, output: Path) -> tuple[str, ...]:
    """The sections that are to be measured.

    Raises:
        UserError: there is no such section, or no result of the others.
    """
    if only is None:
        return SECTIONS
    chosen = tuple(word.strip() for word in only.split(","))
    for name in chosen:
        if name not in SECTIONS:
            raise UnknownNameError("section", name, SECTIONS)
    if "decode" in chosen and "images" not in chosen:
        raise UserError("--only decode: what is decoded is written by `images`; ask for images,decode.")
    if not output.is_file():
        raise UserError(f"--only {only}: {output} is missing, which has the other sections; measure everything first.")
    return chosen


def merged(before: dict[str, Any], body: dict[str, Any], sections: Sequence[str]) -> dict[str, Any]:
    """An earlier result with the figures of some sections replaced; `measured_again` says when, where and of what.

    Ratios compare within a section only, so both sides of each are of one run. `machine` and `versions` of the result
    stay those of everything else. Whole commands and starts go with the rates that they stand beside: those of an
    earlier run, which may be another machine's, would be read as these ones'.
    """
    found = {key: value for key, value in before.items() if key not in ("benchmark", "date")}
    if {"images", "states"} & set(sections):
        found = {key: value for key, value in found.items() if key not in ("commands", "startup")}
    for name in ("frames_per_second", "cpu_ms_per_step", "dataset_mib"):
        kept = {key: value for key, value in before[name].items() if key.partition("_")[0] not in sections}
        both = kept | body[name]
        found[name] = {key: both[key] for key in (*convert_report.ROWS, *both) if key in both}
    if "states" in sections:
        found["scene_loading"] = body["scene_loading"]
    if "lift" in sections:
        found["peer"] = body["peer"]
    found["ratios"] = convert_report.ratios(found["frames_per_second"], found["memory"])
    again = {
        "date": utc_now(),
        "machine": body["machine"],
        "versions": body["versions"],
        "mode": body["mode"],
        "others_share_of_cores": body["others_share_of_cores"],
    }
    return found | {"measured_again": before.get("measured_again", {}) | dict.fromkeys(sections, again)}
