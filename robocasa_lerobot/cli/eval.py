"""`robocasa-lerobot eval`: run seeded trials of policies, here or in shards elsewhere, and write the report."""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import sys
import textwrap
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.parent import add_end_with_input, end_with_input

if TYPE_CHECKING:
    from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig

EXAMPLE = (
    "robocasa-lerobot eval --policy.path=outputs/demo/finetune/checkpoints/last/pretrained_model"
    " --env.tasks=OpenDrawer --trials=10"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare every setting of `EvaluationConfig` as an option, with the help of its docstring."""
    from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
    from robocasa_lerobot.jobs.executors import add_options

    add_options(parser)
    parser.add_argument("--shards", type=int, metavar="N", help="with --executor: into how many parts the plan is cut")
    parser.add_argument("--merge", action="store_true", help="join the results of --shard=1/N to N/N, run nothing")
    add_end_with_input(parser)
    parser.add_argument("--check", action="store_true", help="print what would run, and end; no checkpoint is needed")
    parser.add_argument(
        "--config_path",
        metavar="FILE",
        help="YAML file of settings, or a name in configs/evaluations/: quick; options win over it",
    )
    short = "what to evaluate, short for --policy.path: a checkpoint, openpi://HOST:PORT, demonstrator, random, zero"
    parser.add_argument("--policy", dest="set:policy", metavar="A,B", default=argparse.SUPPRESS, help=short)
    for name, hint, help_text, default in describe_settings(EvaluationConfig):
        options: dict[str, Any] = {"nargs": "?", "const": "true"} if hint is bool else {}
        shown = {list[str]: "A,B", bool: "true|false"}.get(hint, "VALUE")
        text = _with_default(help_text, default).replace("%", "%%")
        parser.add_argument(
            f"--{name}", dest=f"set:{name}", metavar=shown, default=argparse.SUPPRESS, help=text, **options
        )
    # A misspelt setting comes here as well, and is answered with the closest name.
    parser.set_defaults(takes_settings=True, settings=[])


def run(args: argparse.Namespace) -> int:
    """Evaluate, print the success rates, write the report."""
    if args.end_with_input:
        end_with_input()
    from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
    from robocasa_lerobot.evaluation.config.loader import load_config
    from robocasa_lerobot.gl import announce_backend

    given = [f"--{key.removeprefix('set:')}={value}" for key, value in vars(args).items() if key.startswith("set:")]
    path = [f"--config_path={args.config_path}"] if args.config_path else []
    config = load_config(EvaluationConfig, [*path, *given, *args.settings])
    if args.check:
        from robocasa_lerobot.evaluation.planning.check import lines, planned
        from robocasa_lerobot.evaluation.planning.trials import Shard

        if config.shard is not None:
            Shard.parse(config.shard)
        if config.out is not None and Path(config.out).is_file():
            raise UserError(f"--out {config.out} is a file, expected a folder.")
        print("\n".join(lines(config, planned(config))))
        return 0
    if args.executor != "local":
        if args.merge:
            raise UserError(f"--merge joins results and runs nothing: leave --executor {args.executor} out.")
        return _run_elsewhere(config, args)
    if args.shards is not None:
        raise UserError("--shards is for --executor slurm or ray; here give --shard=I/N, and --merge at the end.")
    if not args.merge:
        _begin(config, args.own_process)
    from robocasa_lerobot.evaluation.planning.run_header import partial_sentence
    from robocasa_lerobot.evaluation.run.engine import evaluate, prepare
    from robocasa_lerobot.evaluation.run.merging import merge
    from robocasa_lerobot.evaluation.run.outputs import write_outputs

    evaluation = prepare(config, ask=not args.merge, here=not args.merge)
    header = evaluation.header
    partial = partial_sentence(header.task_sets, header.missing_tasks, header.missing_by_set)
    if partial is not None:
        print(f"robocasa-lerobot eval: this run is {partial}", file=sys.stderr)
    if args.merge:
        if config.shard is not None:
            raise UserError("--merge joins all shards: leave --shard out.")
        merge(evaluation)
        write_outputs(evaluation)
        return 0
    if config.env.is_kitchen:
        announce_backend()
    evaluate(evaluation)
    if config.shard is None:
        write_outputs(evaluation)
    else:
        print(f"shard {config.shard} is complete. When all are: the same command with --merge instead of --shard.")
    return 0


def _begin(config: EvaluationConfig, own_process: bool) -> None:
    """What workers need and takes seconds, while this process goes on reading: their imports."""
    from robocasa_lerobot.evaluation.run.processes import start_importing
    from robocasa_lerobot.gl import ensure_drawing

    if config.env.is_kitchen:
        ensure_drawing()  # inherited by the workers
    folders = [folder for path in config.policy.path if (folder := Path(path)).is_dir()]
    start_importing(folders, config.policy.threads, own_process)


def _run_elsewhere(config: EvaluationConfig, args: argparse.Namespace) -> int:
    from robocasa_lerobot.evaluation.run.distributed import run_distributed
    from robocasa_lerobot.jobs.executors import execution_of

    if args.shards is None:
        raise UserError(f"--executor {args.executor} needs --shards=N: into how many parts the plan is cut.")
    args.workers = None  # the setting `workers` is for each shard
    line = run_distributed(config, args.shards, execution_of(args))
    if line is not None:
        print(line)
    return 0


def describe_settings(cls: type, prefix: str = "") -> Iterator[tuple[str, Any, str, Any]]:
    """(dotted name, type, help, default) of each leaf setting of a dataclass; help is its docstring's `name: text`."""
    hints = typing.get_type_hints(cls)
    documented = _documented(inspect.getdoc(cls) or "")
    for field in dataclasses.fields(cls):
        hint: Any = hints[field.name]
        if dataclasses.is_dataclass(hint):
            yield from describe_settings(typing.cast(type, hint), f"{prefix}{field.name}.")
        else:
            default = field.default if field.default_factory is dataclasses.MISSING else field.default_factory()
            yield f"{prefix}{field.name}", hint, documented[field.name], default


def _with_default(text: str, default: Any) -> str:
    """A setting's help with its default, where it has one and the help does not say which."""
    if default in (None, [], {}) or "default" in text.lower():
        return text
    shown = ",".join(default) if isinstance(default, list) else str(default)
    return f"{text.removesuffix('.')} (default: {shown.lower() if isinstance(default, bool) else shown})."


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
