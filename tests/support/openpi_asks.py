"""`python openpi_asks.py PORT`: openpi's own client asks what stands in `observations.npz`, and writes `answers.npz`.

Runs in an environment with openpi-client and without this package.
"""

from __future__ import annotations

import sys

import numpy as np
from openpi_client.websocket_client_policy import WebsocketClientPolicy  # type: ignore[import-not-found]


def main() -> None:
    """As the module says."""
    client = WebsocketClientPolicy("127.0.0.1", int(sys.argv[1]))
    assert client.get_server_metadata()["server"] == "robocasa_lerobot"
    stored = dict(np.load("observations.npz"))
    instruction, seeds = str(stored.pop("instruction")), stored.pop("seeds").tolist()
    answers = {}
    for number, seed in enumerate(seeds):
        answer = client.infer({**stored, "prompt": instruction, "seed": seed, "number": number})
        answers[str(number)] = answer["actions"]
    np.savez("answers.npz", **answers)
    said = ""
    try:
        client.infer({**stored, "observation/state": np.zeros(3), "prompt": instruction})
    except RuntimeError as error:
        said = str(error)
    assert "observation/state: found" in said, said


if __name__ == "__main__":
    main()
