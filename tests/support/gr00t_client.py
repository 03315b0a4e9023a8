"""A client of GR00T's inference service as its published protocol says: a program of pyzmq, msgpack and numpy alone.

`python gr00t_client.py PORT VERSION`: asks what stands in the file `observations.npz` of the working folder and
writes `answers.npz`. It shares no code with the package, so that a mistake of ours is not made twice.
"""

from __future__ import annotations

import io
import json
import sys
from typing import Any

import msgpack
import numpy as np
import zmq


def to_wire(value: Any) -> Any:
    """An array as the bytes of a npy file."""
    if isinstance(value, np.ndarray):
        stream = io.BytesIO()
        np.save(stream, value, allow_pickle=False)
        return {"__ndarray_class__": True, "as_npy": stream.getvalue()}
    raise TypeError(type(value))


def from_wire(value: dict[str, Any]) -> Any:
    """The reverse; a modality config becomes its map."""
    if "__ndarray_class__" in value:
        return np.load(io.BytesIO(value["as_npy"]), allow_pickle=False)
    if "__ModalityConfig_class__" in value:
        text = value["as_json"]
        return json.loads(text) if isinstance(text, str) else text
    return value


class GrootClient:
    """One REQ socket."""

    def __init__(self, port: int, token: str | None = None) -> None:
        self.socket = zmq.Context.instance().socket(zmq.REQ)
        self.socket.setsockopt(zmq.RCVTIMEO, 60_000)
        self.socket.setsockopt(zmq.LINGER, 0)
        self.socket.connect(f"tcp://127.0.0.1:{port}")
        self.token = token

    def call(self, endpoint: str | None, data: Any = None) -> Any:
        """One request, one answer."""
        request: dict[str, Any] = {} if endpoint is None else {"endpoint": endpoint}
        if data is not None:
            request["data"] = data
        if self.token is not None:
            request["api_token"] = self.token
        return self.send(msgpack.packb(request, default=to_wire))

    def send(self, frame: bytes) -> Any:
        """The answer to any bytes."""
        self.socket.send(frame)
        return msgpack.unpackb(self.socket.recv(), object_hook=from_wire)

    def close(self) -> None:
        """Leave."""
        self.socket.close()


def main() -> None:
    """As the module says."""
    port, version = int(sys.argv[1]), sys.argv[2]
    client = GrootClient(port)
    said = client.call("ping")
    assert (said["status"], said["message"]) == ("ok", "Server is running")
    keys = client.call("get_modality_config")["video"]["modality_keys"]
    stored = dict(np.load("observations.npz"))
    instruction, seeds = str(stored.pop("instruction")), stored.pop("seeds").tolist()
    answers = []
    for number, seed in enumerate(seeds):
        if version == "1.5":
            observation: dict[str, Any] = {**stored, "annotation.human.task_description": [instruction]}
            assert set(keys) <= set(observation)
            answers.append(client.call("get_action", {**observation, "seed": seed, "number": number}))
            continue
        nested: dict[str, Any] = {"video": {}, "state": {}}
        for name, value in stored.items():
            modality, _, key = name.partition(".")
            nested[modality][key] = value[None]
        assert set(keys) <= set(nested["video"])
        nested["language"] = {"annotation.human.task_description": [[instruction]]}
        options = {"seed": seed, "number": number}
        action, _ = client.call("get_action", {"observation": nested, "options": options})
        answers.append({f"action.{key}": value[0] for key, value in action.items()})
    np.savez("answers.npz", **{f"{i}/{key}": value for i, one in enumerate(answers) for key, value in one.items()})


if __name__ == "__main__":
    main()
