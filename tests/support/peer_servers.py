"""`python peer_servers.py openpi|gr00t|vla_eval`: a policy behind another project's own code, on a free port.

Runs in an environment of theirs, without this package. openpi: its client package's msgpack_numpy behind a websocket;
GR00T: its published protocol (N1.6) with pyzmq and msgpack; vla-eval: its own model server, which cuts chunks itself.
The policy is a function of the observation, see `actions`; the port is printed, and the end of standard input ends it.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

CHUNK, SIZE = 4, 12


def actions(state: np.ndarray, picture: np.ndarray, length: int = CHUNK) -> np.ndarray:
    """A chunk (length, 12) in [-1, 1] that depends on every number of a state (16,) and a picture."""
    numbers = [float(value) for value in state.ravel()]
    numbers.append(int(picture.astype(np.int64).sum()) / picture.size / 255.0)
    # Plain floats in a fixed order: the same bits with every version of numpy.
    mixed = sum((0.5 + 0.1 * place) * value for place, value in enumerate(numbers))
    rows = [[(mixed + 0.37 * step * (part + 1)) % 2.0 - 1.0 for part in range(SIZE)] for step in range(1, length + 1)]
    return np.array(rows, dtype=np.float32)


def serve_openpi() -> None:
    """Metadata first, then an answer for each request."""
    from openpi_client import msgpack_numpy  # type: ignore[import-not-found]
    from websockets.sync.server import serve

    def handle(connection: Any) -> None:
        connection.send(msgpack_numpy.packb({}))
        for frame in connection:
            asked = msgpack_numpy.unpackb(frame)
            chunk = actions(asked["observation/state"], asked["observation/image"])
            connection.send(msgpack_numpy.packb({"actions": chunk, "server_timing": {"infer_ms": 0.1}}))

    server = serve(handle, "127.0.0.1", 0, compression=None, max_size=None)
    announce(server.socket.getsockname()[1])
    server.serve_forever()


def serve_gr00t() -> None:
    """A REP socket."""
    import msgpack
    import zmq
    from gr00t_client import from_wire, to_wire

    cameras = ["robot0_agentview_left"]
    state = ["base_position", "base_rotation", "end_effector_position_relative"]
    state += ["end_effector_rotation_relative", "gripper_qpos"]
    sizes = {"base_motion": 4, "control_mode": 1, "end_effector_position": 3, "end_effector_rotation": 3}
    sizes["gripper_close"] = 1
    config = {
        "video": {"delta_indices": [0], "modality_keys": cameras},
        "state": {"delta_indices": [0], "modality_keys": state},
        "action": {"delta_indices": list(range(CHUNK)), "modality_keys": list(sizes)},
        "language": {"delta_indices": [0], "modality_keys": ["annotation.human.task_description"]},
    }

    def answer(request: dict[str, Any]) -> Any:
        endpoint = request.get("endpoint", "get_action")
        if endpoint == "ping":
            return {"status": "ok", "message": "Server is running"}
        if endpoint == "get_modality_config":
            return {name: {"__ModalityConfig_class__": True, "as_json": one} for name, one in config.items()}
        if endpoint == "reset":
            return {}
        asked = request["data"]["observation"]
        parts = [asked["state"][name] for name in state]
        assert all(part.dtype == np.float32 and part.ndim == 3 for part in parts)
        picture = asked["video"][cameras[0]]
        assert picture.dtype == np.uint8
        assert picture.ndim == 5
        chunk = actions(np.concatenate([part[0, -1] for part in parts]), picture)
        ends = np.cumsum(list(sizes.values()))[:-1]
        return [dict(zip(sizes, np.split(chunk[None], ends, axis=-1), strict=True)), {}]

    socket = zmq.Context.instance().socket(zmq.REP)
    announce(socket.bind_to_random_port("tcp://127.0.0.1"))
    while True:
        request = msgpack.unpackb(socket.recv(), object_hook=from_wire)
        socket.send(msgpack.packb(answer(request), default=to_wire))


def serve_vla_eval() -> None:
    """vla-eval's own base class and server."""
    from vla_eval import serve_background  # type: ignore[import-not-found]
    from vla_eval.model_servers.predict import PredictModelServer  # type: ignore[import-not-found]

    order = ["state.end_effector_position_relative", "state.end_effector_rotation_relative", "state.gripper_qpos"]
    order += ["state.base_position", "state.base_rotation"]

    class Server(PredictModelServer):  # type: ignore[misc]
        def predict(self, obs: dict[str, Any], ctx: Any) -> dict[str, Any]:
            state = np.concatenate([np.asarray(obs["state"][name]) for name in order])
            return {"actions": actions(state, obs["images"]["video.robot0_agentview_left"])}

        def get_action_spec(self) -> dict[str, Any]:
            return {}

        def get_observation_spec(self) -> dict[str, Any]:
            return {}

    with serve_background(Server(chunk_size=CHUNK)) as handle:
        announce(int(handle.url.rpartition(":")[2]))
        sys.stdin.read()


def announce(port: int) -> None:
    """Tell who started it."""
    print(port, flush=True)


if __name__ == "__main__":
    {"openpi": serve_openpi, "gr00t": serve_gr00t, "vla_eval": serve_vla_eval}[sys.argv[1]]()
