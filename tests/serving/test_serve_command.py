"""`robocasa-lerobot serve`: starts, answers, ends when told to, and refuses what is unsafe or impossible."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gr00t_client import GrootClient
from websockets.asyncio.client import connect as connect_async
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from robocasa_lerobot import cli, contract
from robocasa_lerobot.serving import server
from robocasa_lerobot.serving.access import Access
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.limits import Limits
from robocasa_lerobot.serving.server import ServerSettings
from robocasa_lerobot.serving.web import serve_websockets
from robocasa_lerobot.wire.codec import decode, encode

TOKEN = "0123456789abcdef-token"


@contextmanager
def command(*arguments: str, **environment: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A server as users start it; gives its process and port."""
    line = [sys.executable, "-m", "robocasa_lerobot.cli", "serve", "--policy.path=random", "--port=0", *arguments]
    process = subprocess.Popen(line, stdout=subprocess.PIPE, text=True, env={**os.environ, **environment})
    try:
        assert process.stdout is not None
        found = re.search(r"serving random .* at \w+://[\d.]+:(\d+);", process.stdout.readline())
        assert found
        yield process, int(found[1])
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_it_answers_and_ends_cleanly_with_a_client_connected(how: signal.Signals) -> None:
    with command() as (process, port), connect(f"ws://127.0.0.1:{port}", compression=None) as connection:
        assert decode(connection.recv(timeout=30))["policy"]["type"] == "random"
        connection.send(encode({"observation.state": np.zeros(16), "task": "x"}, "openpi"))
        assert decode(connection.recv(timeout=30))["actions"].shape == (1, 12)
        process.send_signal(how)
        assert process.wait(30) == 0
        assert "the server has ended" in process.stdout.read()  # type: ignore[union-attr]


def test_it_speaks_vla_eval() -> None:
    with command("--protocol=vla_eval") as (process, port):
        with connect(f"ws://127.0.0.1:{port}", compression=None) as connection:
            hello = {"type": "hello", "payload": {"protocol_version": 1}, "seq": 1, "timestamp": 0.0}
            connection.send(encode(hello, "vla_eval"))
            answer = decode(connection.recv(timeout=30))
            assert (answer["type"], answer["seq"]) == ("hello", 1)
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0


@pytest.mark.parametrize(("options", "prefix"), [(["--groot-version=1.5", "--allow-kill"], "state."), ([], "")])
def test_it_speaks_gr00t_and_its_clients_may_end_it_where_they_are_allowed_to(options: list[str], prefix: str) -> None:
    with command("--protocol=gr00t", *options) as (process, port):
        client = GrootClient(port)
        keys = client.call("get_modality_config")["state"]["modality_keys"]
        assert keys == [prefix + part.name for part in contract.STATE_PARTS]
        answer = client.call("kill")
        if options:
            assert answer["status"] == "ok"
        else:
            assert "--allow-kill" in answer["error"]
            assert client.call("ping")["status"] == "ok"
            process.send_signal(signal.SIGTERM)
        client.close()
        assert process.wait(30) == 0


def test_each_option_reaches_the_policy_and_its_server(checkpoint: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import torch

    made: list[tuple[Host, ServerSettings]] = []
    monkeypatch.setattr(server, "run_server", lambda host, settings, _: made.append((host, settings)) or host.close())
    threads = torch.get_num_threads()
    given = ["--policy.threads=2", "--policy.batch_width=3", "--policy.label=mine", "--executed-steps=5", "--seed=4"]
    given += ["--resize", "--protocol=gr00t", "--groot-version=1.5", "--allow-kill"]
    given += ["--max-message=2", "--max-clients=7", "--port=9"]
    try:
        assert cli.main(["serve", f"--policy.path={checkpoint}"]) == 0
        assert torch.get_num_threads() == 1
        assert cli.main(["serve", f"--policy.path={checkpoint}", *given]) == 0
        assert torch.get_num_threads() == 2
        assert cli.main(["serve", f"--policy.path={checkpoint}", "--repeat-history"]) == 0
    finally:
        torch.set_num_threads(threads)
    (usual, _), (host, settings), (repeating, _) = made
    wanted = [(one.wanted.resize, one.wanted.repeat) for one in (usual, host, repeating)]
    assert wanted == [(False, False), (True, False), (False, True)]
    assert (host.served.source.label, host.served.executed, host.served.width, host._seed) == ("mine", 5, 3, 4)
    assert (usual.served.executed, usual._seed) == (8, 0)
    access, limits = Access("127.0.0.1", 9, None), Limits(2 * 2**20, 7)
    assert settings == ServerSettings("gr00t", access, limits, groot_version="1.5", allow_kill=True)


def test_the_token_is_asked_for_everywhere_but_for_health(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text(TOKEN + "\n")
    with command("--host=0.0.0.0", f"--token-file={file}") as (_, port):
        url = f"ws://127.0.0.1:{port}"
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=30) as page:
            assert page.status == 200
        wrong = [
            {},
            {"Authorization": f"Api-Key {TOKEN}x"},
            {"Authorization": TOKEN},
            {"Authorization": f"Basic {TOKEN}"},
            {"Authorization": "Api-Key"},
            {"Authorization": "Api-Key \xff\xfe"},
            {"Authorization": "Api-Key " + "a" * 5000},
        ]
        for headers in wrong:
            with pytest.raises(InvalidStatus, match="401"), connect(url, additional_headers=headers):
                pass
        with pytest.raises(InvalidStatus, match="401"), connect(f"{url}/?token=wrong"):
            pass
        for right in ({"Authorization": f"Api-Key {TOKEN}"}, {"Authorization": f"Bearer {TOKEN}"}):
            with connect(url, additional_headers=right) as connection:
                assert decode(connection.recv(timeout=30))["server"] == "robocasa_lerobot"


def test_a_page_in_a_browser_may_not_ask_a_server_without_a_token() -> None:
    with command() as (_, port):
        origin: Any = "http://localhost"
        with pytest.raises(InvalidStatus, match="403"), connect(f"ws://127.0.0.1:{port}", origin=origin):
            pass


def test_more_clients_than_allowed_are_sent_away() -> None:
    with command("--max-clients=1") as (_, port), connect(f"ws://127.0.0.1:{port}") as connection:
        connection.recv(timeout=30)
        with pytest.raises(InvalidStatus, match="503"), connect(f"ws://127.0.0.1:{port}"):
            pass


def test_a_client_that_is_gone_without_a_word_does_not_hold_its_place_for_ever() -> None:
    found: dict[str, int] = {}

    async def look(connection: ServerConnection) -> None:
        own = connection.transport.get_extra_info("socket")
        found["alive"] = own.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        for name in ("TCP_KEEPIDLE", "TCP_KEEPINTVL", "TCP_KEEPCNT"):
            found[name] = own.getsockopt(socket.IPPROTO_TCP, getattr(socket, name))

    async def run() -> None:
        stop, ports = asyncio.Event(), asyncio.Queue[int]()
        access = Access("127.0.0.1", 0, None)
        server = asyncio.create_task(serve_websockets(look, {}, {}, access, Limits(), stop, ports.put_nowait))
        async with connect_async(f"ws://127.0.0.1:{await ports.get()}") as connection:
            await connection.wait_closed()
        stop.set()
        await server

    asyncio.run(run())
    assert found["alive"]
    assert found["TCP_KEEPIDLE"] + found["TCP_KEEPINTVL"] * found["TCP_KEEPCNT"] <= 15 * 60  # not the system's hours


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--host=0.0.0.0"], "give a token with --token-file"),
        (["--host=::"], "give a token with --token-file"),
        (["--token-file=missing"], "cannot be read"),
        (["--policy.path=demonstrator"], "the simulator's own state"),
        (["--policy.path=nowhere"], "no such folder"),
        (["--executed-steps=4"], "it acts step by step"),
        (["--port=70000"], "expected 0"),
        (["--max-message=0"], "MiB"),
        (["--max-clients=0"], "at least 1"),
    ],
)
def test_mistakes_are_one_sentence(arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["serve", "--policy.path=random", *arguments]) == 2
    assert text in capsys.readouterr().err


def test_a_short_token_a_taken_port_and_no_host_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert cli.main(["serve", "--policy.path=random", f"--port={port}"]) == 2
        assert "cannot listen" in capsys.readouterr().err
    monkeypatch.setenv("ROBOCASA_LEROBOT_POLICY_TOKEN", TOKEN)
    assert cli.main(["serve", "--policy.path=random", "--host=no..host"]) == 2
    assert "cannot listen on no..host" in capsys.readouterr().err
    monkeypatch.setenv("ROBOCASA_LEROBOT_POLICY_TOKEN", "short")
    assert cli.main(["serve", "--policy.path=random"]) == 2
    assert "at least 16" in capsys.readouterr().err
