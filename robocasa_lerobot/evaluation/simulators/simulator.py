"""Which simulator an evaluation runs in, and what it says about itself before an env is made."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.evaluation.simulators.foreign_worker import PROTOCOL
from robocasa_lerobot.evaluation.simulators.process import EnvRaisedError, ForeignProcess, SimulatorError

FOREIGN_FACTORY = "robocasa_lerobot.evaluation.simulators.foreign_env:make_env"  # by which workers reach it
LEROBOT = "lerobot"  # written --env.type=lerobot:NAME
_LEROBOT_ENVS = Path(__file__).with_name("lerobot_envs.py")


@dataclass(frozen=True)
class Simulator:
    """A factory of envs in an interpreter of its own.

    `factory` is `module:callable` or `FILE.py:callable` there, called with the task and `options`.
    """

    python: str
    factory: str
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Description:
    """What an adapter says: the tasks it knows (None: it does not say), and its versions.

    `starts` are the numbers of fixed starts of tasks that have such: seed 0 is the first of them. `source` is a SHA-256
    over the adapter's file.
    """

    tasks: list[str] | None
    starts: dict[str, int]
    versions: dict[str, str]
    source: str

    def settings(self) -> dict[str, Any]:
        """What a trial's outcome depends on; results of other versions or of another adapter are never mixed."""
        return {"adapter": self.source[:16], "versions": self.versions}


def simulator_of(python: str | None, kind: str | None, factory: str, options: dict[str, Any]) -> Simulator | None:
    """The simulator that settings ask for; None where the env runs in this interpreter.

    Raises:
        UserError: an interpreter that is not there, or a type that is none.
    """
    if python is None and kind is None:
        if options:
            raise UserError("env.options are for envs of another interpreter: give --env.python=PATH or --env.type.")
        return None
    if python is not None and not Path(python).is_file():
        raise UserError(f"env.python: no file {python}; expected a Python interpreter such as sim/bin/python.")
    if kind is not None:
        family, colon, name = kind.partition(":")
        if family != LEROBOT or not (colon and name):
            raise UserError(f"env.type: found {kind!r}, expected lerobot:NAME, such as lerobot:pusht.")
        factory, options = f"{_LEROBOT_ENVS}:make_env", {"type": name, **options}
    return Simulator(str(Path(python).absolute()) if python else sys.executable, factory, options)


def describe(simulator: Simulator, tasks: Sequence[str], seconds: float) -> Description:
    """Ask a simulator about itself, in a process that ends with the answer.

    Raises:
        UserError: its interpreter or adapter does not work, or does not answer within so many seconds, or it does not
            have a task.
    """
    where = f"env.python {simulator.python}, env.factory {Path(simulator.factory).name}"
    try:
        process = ForeignProcess(simulator.python)
        try:
            question = {"factory": simulator.factory, "options": simulator.options, "tasks": list(tasks)}
            said, _ = process.ask_within(seconds, "hello", **question)
        finally:
            process.close()
        if said["protocol"] != PROTOCOL:
            raise UserError(f"{where}: speaks protocol {said['protocol']}, expected {PROTOCOL}.")
        description = Description(said["tasks"], said["starts"], said["versions"], said["source"])
    except EnvRaisedError as error:
        raise UserError(f"{where}: the adapter cannot be loaded there:\n{error}") from error
    except (SimulatorError, KeyError) as error:
        raise UserError(f"{where}: {error}") from error
    for task in tasks:
        if description.tasks is not None and task not in description.tasks:
            raise UnknownNameError("task", task, description.tasks, f"({where})")
    return description


def env_arguments(simulator: Simulator) -> dict[str, Any]:
    """The simulator as an argument of the worker's env factory; picklable."""
    return {"simulator": dataclasses.asdict(simulator)}
