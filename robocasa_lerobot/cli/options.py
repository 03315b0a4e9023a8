"""What several commands share: options of `convert` that say which episodes are taken, and how LeRobot is imported."""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path
from typing import Any


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def add_source_options(parser: argparse.ArgumentParser) -> None:
    """Add the options whose values `source_settings` reads."""
    group = parser.add_argument_group("which episodes")
    group.add_argument(
        "--filter-key",
        metavar="KEY",
        help="those of the list mask/KEY; <N>_demos also without such a list: N by the benchmark's own rule",
    )
    group.add_argument(
        "--demos",
        metavar="WHICH",
        help="of each file: a sample of so many (50) or of such a share (10%%), or names and ranges (demo_3,7-9)",
    )
    group.add_argument("--demos-seed", type=int, default=0, metavar="SEED", help="of samples (default: %(default)s)")
    group = parser.add_argument_group("what of them")
    group.add_argument(
        "--cameras", type=_names, metavar="A,B,C", help="cameras to take (default: the robot's own three)"
    )
    group.add_argument(
        "--image-size", type=int, metavar="PIXELS", help="height and width (default: as stored, else 256)"
    )
    group.add_argument(
        "--instruction",
        metavar="TEXT",
        help="language of episodes that have none recorded; may have fields, such as 'pick up the {obj}'",
    )
    group.add_argument(
        "--replace-instruction", action="store_true", help="take --instruction also where one is recorded"
    )
    group.add_argument(
        "--action-key",
        choices=("actions", "actions_abs"),
        default="actions",
        help="relative or absolute actions, where a file has both (default: %(default)s)",
    )
    group.add_argument(
        "--extra-columns",
        type=_names,
        default=(),
        metavar="KEY,KEY",
        help="further datasets of each episode to keep, such as obs/robot0_joint_pos (feature extra.obs.robot0_...)",
    )
    group.add_argument(
        "--mapping",
        type=Path,
        metavar="YAML",
        help="description of an unknown layout; `robocasa-lerobot inspect FILE --draft-mapping YAML` drafts it",
    )


def source_settings(args: argparse.Namespace) -> dict[str, Any]:
    """Fields of `ConversionSettings` from parsed options.

    Raises:
        UserError: the mapping file cannot be read or is wrong.
    """
    from robocasa_lerobot.convert.mapping.custom import read_mapping

    return {
        "filter_key": args.filter_key,
        "demos": args.demos,
        "demos_seed": args.demos_seed,
        "cameras": args.cameras,
        "image_size": args.image_size,
        "instruction": args.instruction,
        "replace_instruction": args.replace_instruction,
        "action_key": args.action_key,
        "extra_columns": args.extra_columns,
        "mapping": read_mapping(args.mapping) if args.mapping is not None else None,
    }


def import_lerobot_leanly(args: argparse.Namespace) -> None:
    """Import LeRobot without what only its policies need, where the process is this command's alone: 2.5 s less."""
    from robocasa_lerobot.convert.worker_imports import LEAN_LEROBOT

    if args.own_process:
        importlib.import_module(LEAN_LEROBOT)
