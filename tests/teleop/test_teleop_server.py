"""Who may drive, who only watches, and what becomes of clients that do not keep to the protocol."""

from __future__ import annotations

import contextlib
import dataclasses
import socket
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from teleop_support import WAIT_S, Served, served, settings
from websockets.exceptions import ConnectionClosed, InvalidStatus

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.teleop.client import TeleopClient
from robocasa_lerobot.teleop.client_line import MOST_UNACKNOWLEDGED
from robocasa_lerobot.teleop.loop import Inbox
from robocasa_lerobot.teleop.messages import LONGEST_MESSAGE
from robocasa_lerobot.teleop.server import TeleopServer
from robocasa_lerobot.teleop.settings import STALE_S

pytestmark = pytest.mark.render


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with served(settings(tmp_path_factory.mktemp("teleop"))) as running:
        yield running


@pytest.fixture
def operator(session: Served) -> Iterator[TeleopClient]:
    """An operator, alone, in a kitchen where nothing has happened."""
    with TeleopClient(session.address) as client:
        deadline = time.monotonic() + 20
        while client.receive(20) != "hello":
            pass
        while client.said[0]["role"] != "operator" and time.monotonic() < deadline:
            client.send("take")
            if client.receive(20) == "role":
                break
        if client.until_phase("ready", "running", "paused", "review")["phase"] != "ready":
            client.send("redo")
            client.until_told("scene")
            client.until_phase("ready")
        yield client


def get(session: Served, path: str, **headers: str) -> tuple[int, bytes]:
    parts = urlsplit(session.address)
    request = urllib.request.Request(f"http://{parts.netloc}{path}", headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read()


def token(session: Served) -> str:
    return urlsplit(session.address).query.removeprefix("t=")


def go_on(operator: TeleopClient) -> None:
    """Have time run; asked for again where an answer took too long once more, as on a busy machine."""
    deadline = time.monotonic() + WAIT_S
    while operator.frame["phase"] != "running":
        assert time.monotonic() < deadline, operator.frame
        operator.send("resume")
        with contextlib.suppress(TimeoutError):
            operator.until_phase("running", seconds=1.0)


def test_without_the_token_there_is_nothing(session: Served, operator: TeleopClient) -> None:
    map_url = next(told["map"]["url"] for told in operator.said if told["type"] == "scene")
    assert get(session, f"/?t={token(session)}")[0] == 200
    status, picture = get(session, map_url)
    assert (status, picture[:2]) == (200, b"\xff\xd8")
    assert get(session, map_url + "0")[0] == 404
    for path in ("/", "/?t=", "/?t=wrong", "/?t=%C3%A4", "/map.jpg?v=1", "/ws", "/ws?t=wrong"):
        assert get(session, path)[0] == 403, path
    for path in ("/page/../server.py", "/page/%2e%2e/server.py", "/page//etc/passwd", "/page/"):
        assert get(session, path)[0] in (403, 404), path
    with pytest.raises(InvalidStatus, match="403"):
        TeleopClient(session.address + "x")


def test_a_page_of_another_origin_is_refused(session: Served, operator: TeleopClient) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        TeleopClient(session.address, origin="http://elsewhere.example")
    with pytest.raises(InvalidStatus, match="403"):
        TeleopClient(session.address, origin="null")
    with TeleopClient(session.address, origin=f"http://{urlsplit(session.address).netloc}") as same:
        assert same.receive(20) == "hello"


@pytest.mark.parametrize(
    ("message", "code"),
    [
        ("no message", 1008),
        ('{"type": "ack", "frame": "one"}', 1008),
        ('{"type": "ack", "frame": "\\ud800"}', 1008),
        (f'{{"type": "ack", "frame": 1, "{"引" * 60}": 1}}', 1008),
        ('{"type": "input", "frame": 1, "arm": [2, 0, 0, 0, 0, 0]}', 1008),
        ("x" * (LONGEST_MESSAGE + 1), 1009),
        (b"\x00\x01", 1003),
    ],
)
def test_who_sends_what_is_no_message_is_sent_away_alone(
    session: Served, operator: TeleopClient, message: str | bytes, code: int
) -> None:
    with TeleopClient(session.address) as other:
        assert other.receive(20) == "hello"
        other.send_text(message)
        with pytest.raises(ConnectionClosed) as closed:
            other.until(lambda: False, 20)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == code
    operator.send("input", gripper="closed")
    assert operator.until_phase("running")["gripper"] == "closed"


def test_a_second_client_only_watches_until_the_first_is_gone(session: Served, operator: TeleopClient) -> None:
    with TeleopClient(session.address) as viewer:
        assert viewer.until_told("hello")["role"] == "viewer"
        viewer.until_phase("ready")
        viewer.send("input", gripper="closed")
        assert "watching" in viewer.until_told("note")["text"]
        viewer.send("take")
        assert "another client drives" in viewer.until_told("note")["text"]
        assert viewer.frame["phase"] == "ready"
        operator.send("input", arm=[1, 0, 0, 0, 0, 0])
        viewer.until_phase("running")
        assert (viewer.frame["operator"], viewer.frame["viewers"], len(viewer.pictures)) == (True, 1, 4)
        operator.close()
        assert viewer.until_phase("paused")["pause"] == "disconnected"
        viewer.send("take")
        assert viewer.until_told("role")["role"] == "operator"
        step = viewer.frame["step"]
        viewer.send("resume")
        viewer.until(lambda: viewer.frame["phase"] == "running" and viewer.frame["step"] > step)


def test_pictures_wait_for_who_does_not_acknowledge_and_time_stands(session: Served, operator: TeleopClient) -> None:
    with TeleopClient(session.address) as viewer:
        operator._acknowledges = False
        last = operator.frame["id"]
        operator.send("start")
        assert viewer.until_phase("paused")["pause"] == "stale"
        came = 0
        while operator.frame["id"] != viewer.frame["id"] and came <= MOST_UNACKNOWLEDGED:
            try:
                came += operator.receive(0.3) == "frame"
            except TimeoutError:
                break
        assert 0 < came <= MOST_UNACKNOWLEDGED
        operator._acknowledges = True
        operator.send("ack", frame=operator.frame["id"])
        operator.until(lambda: operator.frame["id"] > last + MOST_UNACKNOWLEDGED)
        go_on(operator)


def test_who_has_long_answered_no_picture_cannot_have_time_run(session: Served, operator: TeleopClient) -> None:
    with TeleopClient(session.address) as viewer:
        operator._acknowledges = False
        last = operator.frame["id"]
        operator.until(lambda: operator.frame["id"] > last)
        time.sleep(2 * STALE_S)  # while nothing runs that is nobody's matter
        operator.send("start")
        assert viewer.until_phase("paused")["pause"] == "stale"
        shown = viewer.frame["id"]
        operator.send("resume")
        viewer.until(lambda: viewer.frame["id"] > shown + 3)
        assert (viewer.frame["phase"], viewer.frame["pause"], viewer.frame["late"]) == ("paused", "stale", True)
        operator._acknowledges = True
        operator.send("ack", frame=operator.frame["id"])
        operator.until(lambda: not operator.frame["late"])
        go_on(operator)


def test_the_age_of_the_picture_that_a_command_answers_is_told(operator: TeleopClient) -> None:
    answered = operator.frame["id"]
    time.sleep(0.2)
    operator.send("input", frame=answered, gripper="closed")
    operator.until(lambda: operator.frame["age_ms"] is not None)
    assert 150 < operator.frame["age_ms"]


def test_a_port_that_is_taken_is_a_mistake_with_a_remedy(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        server = TeleopServer(dataclasses.replace(settings(tmp_path)), Inbox(), port=taken.getsockname()[1])
        with pytest.raises(UserError, match=r"Choose another --port"):
            server.start()


@pytest.mark.parametrize(("host", "port"), [("127.0.0.1", 70_000), ("127.0.0.1", -1), ("no host", 0)])
def test_an_address_that_cannot_be_is_a_mistake_with_a_remedy(tmp_path: Path, host: str, port: int) -> None:
    with pytest.raises(UserError, match=r"Choose another --port or --host"):
        TeleopServer(dataclasses.replace(settings(tmp_path)), Inbox(), host=host, port=port).start()
