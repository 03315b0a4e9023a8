"""The console command `robocasa-lerobot`: one subcommand per job, each in a module of its own, imported on use."""

from __future__ import annotations

import argparse
import errno
import importlib
import os
import select
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from robocasa_lerobot import __version__
from robocasa_lerobot.errors import UserError, suggest
from robocasa_lerobot.gl import failed_backend
from robocasa_lerobot.jobs.importing import rare_collections
from robocasa_lerobot.jobs.workers import check_workers

# Errors of a path that the user gave.
_NAMED = (FileExistsError, FileNotFoundError, IsADirectoryError, NotADirectoryError, PermissionError)
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # a disk, one's share of it, or the largest file that it takes


@dataclass(frozen=True)
class Subcommand:
    """Where a subcommand lives.

    Its module has `EXAMPLE: str`, `configure(parser: argparse.ArgumentParser) -> None` and
    `run(args: argparse.Namespace) -> int`, and imports anything heavy (torch, mujoco, lerobot) inside `run`.
    `args.own_process` tells it whether the process is the command's alone, and not a test's or a notebook's.
    With `parser.set_defaults(takes_settings=True, settings=[])` arguments that the parser does not know come in
    `args.settings`: a command with a typed configuration answers them better than argparse would.
    """

    module: str
    summary: str


SUBCOMMANDS: dict[str, Subcommand] = {
    "demos": Subcommand("robocasa_lerobot.cli.demos", "record demonstrations of tasks as HDF5"),
    "teleop": Subcommand("robocasa_lerobot.cli.teleop", "record demonstrations by hand, in a browser"),
    "replay": Subcommand("robocasa_lerobot.cli.replay", "check that demonstrations can be replayed"),
    "correct": Subcommand("robocasa_lerobot.cli.correct", "let demonstrators take over from a policy, and record it"),
    "prepare": Subcommand("robocasa_lerobot.cli.prepare", "make demonstrations ready to be sources of `generate`"),
    "generate": Subcommand("robocasa_lerobot.cli.generate", "make demonstrations in new scenes out of prepared ones"),
    "convert": Subcommand("robocasa_lerobot.cli.convert", "convert demonstration files to a LeRobotDataset v3.0"),
    "inspect": Subcommand(
        "robocasa_lerobot.cli.inspect", "print what a file, dataset or registry holds, draft a mapping"
    ),
    "verify": Subcommand("robocasa_lerobot.cli.verify", "compare a converted dataset with its source"),
    "export": Subcommand("robocasa_lerobot.cli.export", "write a LeRobotDataset v3.0 back to HDF5"),
    "render": Subcommand("robocasa_lerobot.cli.render", "render a dataset again with other cameras, sizes or presets"),
    "data": Subcommand("robocasa_lerobot.cli.data", "list the data that an experiment needs, and make missing ones"),
    "train": Subcommand("robocasa_lerobot.cli.train", "run the training phases of an experiment file"),
    "eval": Subcommand("robocasa_lerobot.cli.eval", "run seeded trials of a policy and report"),
    "serve": Subcommand("robocasa_lerobot.cli.serve", "answer others' evaluations with a policy, over a socket"),
    "study": Subcommand("robocasa_lerobot.cli.study", "run the trainings of a study, from data to trials and tables"),
    "report": Subcommand("robocasa_lerobot.cli.report", "compare runs: report.html, .md, .tex and .csv"),
    "leaderboard": Subcommand(
        "robocasa_lerobot.cli.leaderboard", "write or check a submission to the public leaderboard"
    ),
    "gallery": Subcommand("robocasa_lerobot.cli.gallery", "render tasks, kitchens, appliances and objects to pictures"),
    "view": Subcommand("robocasa_lerobot.cli.view", "open a task's scene in MuJoCo's viewer"),
    "tasks": Subcommand("robocasa_lerobot.cli.tasks", "list the tasks, their sets and horizons"),
    "doctor": Subcommand("robocasa_lerobot.cli.doctor", "check this machine and name the command that mends a fault"),
}


def _about_path(error: OSError) -> str:
    """What is wrong with a path, and with which part of it."""
    path = Path(os.fsdecode(error.filename))
    if isinstance(error, NotADirectoryError | FileExistsError):
        blocking = next((part for part in (path, *path.parents) if part.is_file()), None)
        if blocking is not None:
            return f"{blocking} is a file, where a folder is needed. Choose another name, or remove it."
    return f"{error.filename}: {error.strerror}."


def _nobody_reads() -> bool:
    """Whether standard output goes to a program that has ended, such as `head`; then nothing is written there again."""
    try:
        sys.stdout.flush()
        gone = _has_no_reader(sys.stdout.fileno())  # unbuffered, there is nothing to flush
    except BrokenPipeError:
        gone = True
    if gone:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return gone


def _has_no_reader(file: int) -> bool:
    if not hasattr(select, "poll"):
        return False
    poller = select.poll()
    poller.register(file, select.POLLOUT)
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in poller.poll(0))


def _is_other_checkout(folder: Path) -> bool:
    """Whether a folder is a checkout of this package, but not of the one that runs: the one that is installed."""
    there = folder / "robocasa_lerobot" / "cli" / "__init__.py"
    return there.is_file() and not there.samefile(__file__)


def build_parser(names: Sequence[str] = tuple(SUBCOMMANDS)) -> argparse.ArgumentParser:
    """The parser with the given subcommands configured (importing only their modules)."""
    parser = argparse.ArgumentParser(prog="robocasa-lerobot", description="Train and benchmark robots in kitchens.")
    parser.add_argument("--version", action="version", version=f"robocasa-lerobot {__version__}")
    subparsers = parser.add_subparsers(dest="subcommand", metavar="COMMAND")
    for name, subcommand in SUBCOMMANDS.items():
        if name not in names:
            subparsers.add_parser(name, help=subcommand.summary)
            continue
        module: ModuleType = importlib.import_module(subcommand.module)
        child = subparsers.add_parser(
            name,
            help=subcommand.summary,
            description=subcommand.summary[0].upper() + subcommand.summary[1:] + ".",
            epilog=f"example:\n  {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,  # a part of an option's name is a guess, and the next version may have two of these
        )
        module.configure(child)
        child.set_defaults(run=module.run)
    return parser


def _subparser(parser: argparse.ArgumentParser, name: str) -> argparse.ArgumentParser:
    (subparsers,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    found: argparse.ArgumentParser = subparsers.choices[name]
    return found


def _spelt(argument: str, options: Sequence[str]) -> str:
    """An argument as it was given, or with `-` for `_` or the other way round where an option is spelt so."""
    name, equals, value = argument.partition("=")
    if not name.startswith("--") or name in options:
        return argument
    alike = [option for option in options if option[2:].replace("_", "-") == name[2:].replace("_", "-")]
    return f"{alike[0]}{equals}{value}" if alike else argument


def _unknown(arguments: Sequence[str], options: Sequence[str]) -> Iterator[str]:
    for argument in arguments:
        name = argument.partition("=")[0]
        if name.startswith("--") and name not in (*options, "--version", "--"):
            yield name


def main(argv: Sequence[str] | None = None, own_process: bool | None = None) -> int:
    """Run a subcommand; returns its exit status. A user's mistake is printed in one paragraph, with status 2.

    Args:
        argv: what was given (default: to this program).
        own_process: whether nothing else is done in this process (default: where `argv` is not given).
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    name = next((a for a in arguments if not a.startswith("-")), None)
    if name is not None and name not in SUBCOMMANDS:
        print(f"robocasa-lerobot: unknown command {name!r}. {suggest(name, SUBCOMMANDS)}", file=sys.stderr)
        return 2
    parser = build_parser([name] if name else [])
    if name is None:
        parser.parse_args(arguments)
        parser.print_help()
        return 0
    child = _subparser(parser, name)
    options = [option for option in child._option_string_actions if option.startswith("--")]
    arguments = [_spelt(argument, options) for argument in arguments]
    takes_settings = child.get_default("takes_settings")
    for wrong in () if takes_settings else _unknown(arguments, options):  # before argparse misses what was meant by it
        print(f"robocasa-lerobot {name}: unknown option {wrong!r}. {suggest(wrong, options)}", file=sys.stderr)
        return 2
    args, unknown = parser.parse_known_args(arguments)
    if unknown and not takes_settings:
        child.error(f"unrecognized arguments: {' '.join(unknown)}")
    if _is_other_checkout(Path.cwd()):
        print(
            f"robocasa-lerobot {name}: this folder is another checkout than the one that runs; PYTHONPATH={Path.cwd()} "
            "before the command has this one run.",
            file=sys.stderr,
        )
    try:
        if unknown:
            args.settings = unknown
        args.own_process = argv is None if own_process is None else own_process
        check_workers(getattr(args, "workers", None))
        if hasattr(args, "executor"):
            from robocasa_lerobot.jobs.executors import check_options

            check_options(args)
        with rare_collections():
            return int(args.run(args) or 0)
    except UserError as error:
        print(f"robocasa-lerobot {name}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        if not _nobody_reads():
            raise
        return 141  # as a shell says of a program that SIGPIPE has ended
    except _NAMED as error:
        if error.filename is None:
            raise
        print(f"robocasa-lerobot {name}: {_about_path(error)}", file=sys.stderr)
        return 2
    except OSError as error:
        if error.errno not in _FULL:
            raise
        print(f"robocasa-lerobot {name}: {error}. Free disk space, and give the command again.", file=sys.stderr)
        return 2
    except Exception as error:
        if (failed := failed_backend(error)) is None:
            raise
        print(f"robocasa-lerobot {name}: {failed}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"\nrobocasa-lerobot {name}: interrupted", file=sys.stderr)
        return 130
