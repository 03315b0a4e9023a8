"""`robocasa-lerobot eval`: run seeded trials of policies and write the report."""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import textwrap
import typing
from collections.abc import Iterator
from typing import Any

EXAMPLE = (
    "robocasa-lerobot eval --policy.path=outputs/demo/finetune/checkpoints/last/pretrained_model"
    " --env.tasks=OpenDrawer --trials=10"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare every setting of `EvaluationConfig` as an option, with the help of its docstring."""
    from robocasa_lerobot.evaluation.config import EvaluationConfig

    parser.add_argument("--config_path", metavar="FILE", help="YAML file of settings; options win over it")
    short = "what to evaluate, short for --policy.path: a checkpoint, demonstrator, random, zero, replay:FILE"
    parser.add_argument("--policy", dest="set:policy", metavar="A,B", default=argparse.SUPPRESS, help=short)
    for name, hint, help_text in describe_settings(EvaluationConfig):
        options: dict[str, Any] = {"nargs": "?", "const": "true"} if hint is bool else {}
        shown = {list[str]: "A,B", bool: "true"}.get(hint, "VALUE")
        text = help_text.replace("%", "%%")
        parser.add_argument(
            f"--{name}", dest=f"set:{name}", metavar=shown, default=argparse.SUPPRESS, help=text, **options
        )
    # A misspelt setting comes here as well, and is answered with the closest name.
    parser.set_defaults(takes_settings=True, settings=[])


def run(args: argparse.Namespace) -> int:
    """Evaluate, print the success rates, write the report."""
    from robocasa_lerobot.evaluation.config import KITCHEN_ENV_FACTORY, EvaluationConfig
    from robocasa_lerobot.evaluation.engine import evaluate, prepare
    from robocasa_lerobot.evaluation.overrides import load_config
    from robocasa_lerobot.gl import announce_backend, check_device, ensure_gl

    given = [f"--{key.removeprefix('set:')}={value}" for key, value in vars(args).items() if key.startswith("set:")]
    path = [f"--config_path={args.config_path}"] if args.config_path else []
    config = load_config(EvaluationConfig, [*path, *given, *args.settings])
    for device in config.env.render_devices:
        check_device(device)
    evaluation = prepare(config)
    if config.env.factory == KITCHEN_ENV_FACTORY:
        ensure_gl()  # Inherited by the workers.
        announce_backend()
    evaluate(evaluation)
    from robocasa_lerobot.evaluation.report_command import print_rates, write_report

    print_rates([evaluation.out])
    if config.report:
        write_report([evaluation.out], out=evaluation.out / "report.html")
    return 0


def describe_settings(cls: type, prefix: str = "") -> Iterator[tuple[str, Any, str]]:
    """(dotted name, type, help) of each leaf setting of a dataclass; the help is its docstring's `name: text` line."""
    hints = typing.get_type_hints(cls)
    documented = _documented(inspect.getdoc(cls) or "")
    for field in dataclasses.fields(cls):
        hint: Any = hints[field.name]
        if dataclasses.is_dataclass(hint):
            yield from describe_settings(typing.cast(type, hint), f"{prefix}{field.name}.")
        else:
            yield f"{prefix}{field.name}", hint, documented[field.name]


def _documented(doc: str) -> dict[str, str]:
    out: dict[str, str] = {}
    name = ""
    for line in textwrap.dedent(doc).splitlines():
        head, colon, text = line.partition(": ")
        if colon and head.isidentifier():
            name = head
            out[name] = text.strip()
        elif name and line.startswith("    "):
            out[name] += " " + line.strip()
        else:
            name = ""
    return out
