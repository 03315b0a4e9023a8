"""The policy servers of a run: one process for each device, watched and replaced by the engine."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.run.messages import Loading, Refused, ServerSettings
from robocasa_lerobot.evaluation.run.processes import (
    POLICY_SERVER,
    cause_of_death,
    process_context,
    run_in,
    thread_limit,
)

MAX_RESTARTS = 10
# No sign of life comes while a process starts, or loads weights from a slow disk.
LOADING_SECONDS = 900.0


@dataclass
class _Server:
    settings: ServerSettings
    process: ForkServerProcess
    connection: Connection
    last_sign: float
    loading: bool = True


class ServerPool:
    """Policy servers, started at once and ended by `close`.

    Args:
        settings: of every server; device and address are filled in.
        devices: one server for each.
        stall_seconds: a server without a sign of life for so long is killed and replaced.
    """

    def __init__(self, settings: ServerSettings, devices: Sequence[str], stall_seconds: float) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="robocasa-lerobot-"))
        self._context = process_context(checkpoints=True)
        self._stall_seconds, self._restarts = stall_seconds, 0
        self._servers = [
            self._start(replace(settings, device=device, address=str(self._folder / f"policy-{i}")))
            for i, device in enumerate(devices)
        ]

    @property
    def addresses(self) -> list[str]:
        """Where workers connect to."""
        return [server.settings.address for server in self._servers]

    @property
    def connections(self) -> list[Connection]:
        """Pipes that `attend` wants to know about."""
        return [server.connection for server in self._servers]

    def attend(self, ready: Sequence[object]) -> None:
        """Read what the servers report, and replace those that have ended or hang.

        Raises:
            UserError: a policy cannot be loaded, or servers end again and again.
        """
        for server in list(self._servers):
            if server.connection in ready:
                try:
                    message = server.connection.recv()
                except (EOFError, ConnectionResetError):
                    self._replace(server, cause_of_death(server.process, "policy process"))
                    continue
                server.last_sign = time.monotonic()
                if isinstance(message, Refused):
                    raise UserError(message.message)
                server.loading = isinstance(message, Loading)
            elif time.monotonic() - server.last_sign > max(self._stall_seconds, LOADING_SECONDS * server.loading):
                server.process.kill()
                self._replace(server, f"no sign of life for {self._stall_seconds:g} s")

    def close(self) -> None:
        """End the servers."""
        for server in self._servers:
            server.connection.close()
            server.process.kill()  # it holds nothing that could be lost
        for server in self._servers:
            server.process.join()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _replace(self, server: _Server, cause: str) -> None:
        server.process.join(timeout=10)
        server.connection.close()
        self._restarts += 1
        if self._restarts > MAX_RESTARTS:
            raise UserError(f"the policy's process on {server.settings.device} ended {self._restarts} times: {cause}.")
        self._servers[self._servers.index(server)] = self._start(server.settings)

    def _start(self, settings: ServerSettings) -> _Server:
        ours, theirs = self._context.Pipe()
        with thread_limit(settings.threads):
            environment = dict(os.environ)
            process = self._context.Process(
                target=run_in, args=(POLICY_SERVER, theirs, settings, environment), daemon=True
            )
            process.start()
        theirs.close()
        return _Server(settings, process, ours, time.monotonic())
