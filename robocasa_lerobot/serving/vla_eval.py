"""vla-eval's protocol: one action for each observation of an episode, over a WebSocket.

Every message is a map of `type`, `payload`, `seq` and `timestamp`. The chunks are this side's matter: an episode's
observations come step by step, so that histories and chunks are exactly those of an evaluation in process.
`episode_start` may give the trial's seed, as `seed` in its payload or `policy_seed` in the payload's `task`; so may the
episode's first observation, as `seed`.
Source: vla-eval 0.8.0.
"""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from http import HTTPStatus
from typing import Any

import numpy as np
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from robocasa_lerobot import __version__, contract
from robocasa_lerobot.evaluation.actors.actor import ChunkActor, ChunkReply, ChunkRequest, ChunkShape, Observation
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.limits import Limits
from robocasa_lerobot.serving.observations import read_observation
from robocasa_lerobot.serving.openpi import describe, is_clients_mistake
from robocasa_lerobot.serving.request import RequestError, Session, whole_number
from robocasa_lerobot.wire.codec import decode, encode
from robocasa_lerobot.wire.images import decode_images

PROTOCOL_VERSION = 1
OPEN_PAGES = {"/health": '{"status": "ok"}\n'}
# What vla-eval's own RoboCasa365 benchmark says of its actions and observations, in its names.
_ACTION_SPEC: dict[str, dict[str, Any]] = {
    "position": {"name": "position", "dims": 3, "format": "delta_xyz", "range": [-1, 1]},
    "rotation": {"name": "rotation", "dims": 3, "format": "axis_angle", "range": [-3.15, 3.15]},
    "gripper": {"name": "gripper", "dims": 1, "format": "binary_close_01", "description": "closed from 0.5 on"},
    "base_motion": {"name": "base_motion", "dims": 4, "format": "base_velocity3_torso1", "range": [-1, 1]},
    "control_mode": {"name": "control_mode", "dims": 1, "format": "base_mode_01", "description": "base from 0.5 on"},
}
_OBSERVATION_SPEC: dict[str, dict[str, Any]] = {
    "image": {"name": "image", "dims": 0, "format": "rgb_hwc_uint8"},
    "state": {"name": "raw", "dims": 0, "format": "raw"},
    "language": {"name": "language", "dims": 0, "format": "language"},
}
_log = logging.getLogger(__name__)


class VlaEvalServer:
    """Answers one client's connection after the other's messages."""

    def __init__(self, host: Host, limits: Limits) -> None:
        self._host, self._limits = host, limits
        # Each waits for the policy most of the time, and must never wait for a thread of another.
        self._waiting = ThreadPoolExecutor(limits.clients, thread_name_prefix="episode")

    def pages(self) -> dict[str, Any]:
        """HTTP answers for who has the token."""
        return {"/config": self._config}

    def _config(self, query: Mapping[str, list[str]]) -> tuple[HTTPStatus, str]:
        """The settings that others' servers let clients change; here they are fixed."""
        wrong = [f"{key}: cannot be changed while the policy is served" for key in query if key != "token"]
        if wrong:
            return HTTPStatus.UNPROCESSABLE_ENTITY, json.dumps({"errors": wrong}) + "\n"
        config = {"max_batch_size": self._host.served.width, "executed_steps": self._host.served.executed}
        return HTTPStatus.OK, json.dumps({"applied": {}, "config": config}) + "\n"

    async def handle(self, connection: ServerConnection) -> None:
        """Serve a client until it leaves; a mistake is told, and the next message answered."""
        session = self._host.session()
        episode: Episode | None = None
        async for frame in connection:
            sequence = 0
            try:
                kind, payload, sequence = await asyncio.to_thread(self._read, frame)
                if kind == "hello":
                    await connection.send(self._pack("hello", self._hello(payload), sequence))
                elif kind == "episode_start":
                    episode = None  # what is refused leaves none of before to be answered
                    session.begin(_seed(payload))
                    episode = Episode(self._host, session)
                elif kind == "observation":
                    if episode is None:
                        raise RequestError("an observation came before episode_start")
                    loop = asyncio.get_running_loop()
                    action = await loop.run_in_executor(self._waiting, episode.act, payload)
                    await connection.send(self._pack("action", {"actions": action}, sequence))
                elif kind == "episode_end":
                    episode = None
                elif kind == "error":
                    _log.warning("a client says: %.200a", payload)
                else:
                    raise RequestError(f"type: found {kind!r:.60}, which no client sends.")
            except ConnectionClosed:
                raise
            except Exception as error:
                text = describe(error)
                if episode is not None and episode.broken:
                    episode, text = None, f"{text}; the episode has ended with it: begin another with episode_start"
                _log.warning("a client's request failed: %a", text, exc_info=not is_clients_mistake(error))
                await connection.send(self._pack("error", {"error": text}, sequence))

    def _read(self, frame: str | bytes) -> tuple[Any, Mapping[Any, Any], int]:
        if isinstance(frame, str):
            raise RequestError("found a text frame, expected a binary one with a map in msgpack.")
        message = decode_images(decode(frame, self._limits.message_bytes))
        if not isinstance(message, Mapping) or not {"type", "payload", "seq"} <= set(message):
            raise RequestError("expected a map of type, payload, seq and timestamp.")
        payload, sequence = message["payload"], message["seq"]
        if not isinstance(payload, Mapping) or isinstance(sequence, bool) or not isinstance(sequence, int):
            raise RequestError("expected a map as payload, and a whole number as seq.")
        return message["type"], payload, sequence

    def _hello(self, payload: Mapping[Any, Any]) -> dict[str, Any]:
        version = payload.get("protocol_version", PROTOCOL_VERSION)
        if version != PROTOCOL_VERSION:
            raise RequestError(f"protocol_version: found {version!r:.20}, expected {PROTOCOL_VERSION}.")
        served = self._host.served
        size = served.image_size
        chunk = {"executed_steps": served.executed, "history_offsets": list(served.offsets)}
        return {
            **served.metadata(),
            # What a client has to do with it, which sends every step and gets one action.
            "executed_steps": 1,
            "history_offsets": [0],
            "chunk": chunk,
            "harness_version": f"robocasa_lerobot {__version__}",
            "protocol_version": PROTOCOL_VERSION,
            "model_server": "robocasa_lerobot",
            "capabilities": {},
            "observation_params": {"camera_size": size[0]} if size is not None and size[0] == size[1] else {},
            "action_spec": _ACTION_SPEC,
            "observation_spec": _OBSERVATION_SPEC,
        }

    @staticmethod
    def _pack(kind: str, payload: dict[str, Any], sequence: int) -> bytes:
        message = {"type": kind, "payload": payload, "seq": sequence, "timestamp": time.time()}
        return encode(message, "vla_eval")

    def close(self) -> None:
        """Let go of the threads."""
        self._waiting.shutdown(wait=False, cancel_futures=True)


class Episode:
    """One trial: its history of observations and its queue of actions.

    Attributes:
        broken: whether the policy has failed, which leaves history and queue between two steps.
    """

    def __init__(self, host: Host, session: Session) -> None:
        self._host, self._session = host, session
        seed, _ = session.next()
        self._stored_order = False
        shape = ChunkShape(host.served.executed, host.served.offsets)
        self._actor = ChunkActor(host.served.source.label, shape, self._predict)
        self._actor.reset(seed, None)
        self._step = 0
        self.broken = False

    def act(self, payload: Mapping[Any, Any]) -> np.ndarray:
        """The action (12,) for the next observation, in the order that its names stand for.

        Raises:
            RequestError: the observation is not what the policy needs; anything else is the policy's.
        """
        seed = whole_number(payload, "seed") if self._step == 0 else None
        if seed is not None:
            self._session.begin(seed)
            self._actor.reset(seed, None)
        observation: Observation = {}
        instruction = ""
        if self._actor.sees(self._step):
            asked = read_observation(payload, self._host.wanted_now)
            observation, instruction = asked.observations[0], asked.instruction
            self._stored_order = asked.stored_order
        self.broken = True
        action = self._actor.act(observation, instruction)
        self.broken = False
        self._step += 1
        return action if self._stored_order else contract.stored_to_hdf5(action)

    def _predict(self, request: ChunkRequest) -> ChunkReply:
        return ChunkReply(self._host.submit(self._session, request).result(), 0.0)


def _seed(payload: Mapping[Any, Any]) -> int | None:
    """The seed that an episode's start gives, or None."""
    task = payload.get("task")
    inside = whole_number(task, "policy_seed") if isinstance(task, Mapping) else None
    given = whole_number(payload, "seed")
    return inside if given is None else given
