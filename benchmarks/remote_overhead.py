"""What it costs to ask a policy over a socket instead of in process, on the loopback of this machine.

For each of the three protocols the time of a request with three 256x256 pictures to a server that computes nothing: all
of it is overhead (our translation, both codecs, the socket, and our reading of the answer). Then four workers on one
openpi server that computes 50 ms for each request, one at a time as openpi's does, beside that computation alone.

    python benchmarks/remote_overhead.py --quick
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import common
from workers import Worker

from robocasa_lerobot.progress import Bar

OUTPUT = common.RESULTS / "remote_overhead.json"
PROTOCOLS = ("openpi", "gr00t", "vla_eval")
AIM_MS = 10.0
WORKERS, COMPUTE_MS = 4, 50.0
RESIZED = 224  # pixels, as openpi's clients do it
HERE = Path(__file__).parent


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few requests: about a quarter of a minute")
    parser.add_argument(
        "--output", type=Path, default=OUTPUT, help=f"JSON file; default: {OUTPUT.relative_to(common.REPOSITORY)}"
    )
    return parser.parse_args(arguments)


def start(stack: ExitStack, name: str, program: Path) -> Worker:
    """A process of this environment; ours finds this checkout's package, the server needs nothing of ours."""
    return stack.enter_context(Worker(name, Path(sys.executable), program))


def overhead(protocol: str, repetitions: int, requests: int) -> dict[str, Any]:
    """Milliseconds of a request: the median of each repetition, the share of slow ones over all."""
    with ExitStack() as stack:
        server = start(stack, "server", HERE / "peers/policy_server.py")
        client = start(stack, "client", HERE / "remote_client.py")
        port = server.ask("open", protocol=protocol)["port"]
        found: dict[str, Any] = {}
        for name, size in (("as_rendered", None), (f"resized_to_{RESIZED}", RESIZED)):
            client.ask("connect", url=f"{protocol}://127.0.0.1:{port}", size=size)
            runs = [sorted(client.ask("requests", count=requests)["milliseconds"]) for _ in range(repetitions)]
            together = sorted(value for run in runs for value in run)
            found[name] = {
                "milliseconds": common.spread([run[len(run) // 2] for run in runs]),
                "mean": sum(together) / len(together),
                "p99": together[int(0.99 * (len(together) - 1))],
            }
        return found


def four_workers(repetitions: int, seconds: float) -> dict[str, Any]:
    """Requests per second of the computation alone, of one and of four workers on one server."""
    with ExitStack() as stack:
        server = start(stack, "server", HERE / "peers/policy_server.py")
        clients = [start(stack, f"client {i}", HERE / "remote_client.py") for i in range(WORKERS)]
        port = server.ask("open", protocol="openpi")["port"]
        for client in clients:
            client.ask("connect", url=f"openpi://127.0.0.1:{port}")
        server.ask("compute", milliseconds=COMPUTE_MS)
        rates: dict[str, list[float]] = {"own": [], "one_worker": [], f"{WORKERS}_workers": []}
        for _ in range(repetitions):
            rates["own"].append(server.ask("own", requests=round(1000 * seconds / COMPUTE_MS))["per_second"])
            rates["one_worker"].append(_rate(clients[:1], seconds))
            rates[f"{WORKERS}_workers"].append(_rate(clients, seconds))
        return {name: common.spread(values) for name, values in rates.items()}


def _rate(clients: Sequence[Worker], seconds: float) -> float:
    at = time.perf_counter() + 0.3
    for client in clients:
        client.send("run", at=at, seconds=seconds)
    answers = [client.receive() for client in clients]
    return float(sum(answer["requests"] for answer in answers) / max(answer["seconds"] for answer in answers))


def ratios(overheads: dict[str, Any], rates: dict[str, Any]) -> dict[str, float]:
    """Above 1: quicker than the aim; and the share of the server's own rate, of which the aim is 0.9."""
    out = {
        f"{AIM_MS:g} ms over a request of {protocol}": AIM_MS / found["as_rendered"]["milliseconds"]["median"]
        for protocol, found in overheads.items()
    }
    workers = f"{WORKERS}_workers"
    out[f"{WORKERS} workers over the server's own rate"] = rates[workers]["median"] / rates["own"]["median"]
    return out


def report(body: dict[str, Any]) -> str:
    """Tables for the terminal."""
    rows = [
        (f"{protocol}, {name.replace('_', ' ')}", *(f"{found[key]:.2f}" for key in ("mean", "p99")),
         f"{found['milliseconds']['median']:.2f}")
        for protocol, kinds in body["overhead_ms"].items()
        for name, found in kinds.items()
    ]  # fmt: skip
    lines = [common.table(("request, ms", "mean", "99 %", "median"), rows), ""]
    rates = [
        (name.replace("_", " "), f"{values['median']:.2f}") for name, values in body["requests_per_second"].items()
    ]
    lines += [common.table((f"{COMPUTE_MS:g} ms of computing", "requests/s"), rates), ""]
    return "\n".join([*lines, *(f"{ratio:.2f}: {name}" for name, ratio in body["ratios"].items())])


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    options = parse(arguments)
    repetitions, requests, seconds = (1, 40, 1.0) if options.quick else (5, 300, 10.0)
    noise = [busy for busy in (common.busy_share(),) if busy is not None]
    with Bar(total=len(PROTOCOLS) + 1, unit="part") as bar:
        overheads = {}
        for protocol in PROTOCOLS:
            overheads[protocol] = overhead(protocol, repetitions, requests)
            bar.update()
        rates = four_workers(repetitions, seconds)
        bar.update()
    noise += [busy for busy in (common.busy_share(),) if busy is not None]
    body = {
        "mode": "quick" if options.quick else "full",
        "machine": common.machine(),
        "versions": common.versions("robocasa-lerobot", "websockets", "msgpack", "pyzmq", "numpy"),
        "ratios": ratios(overheads, rates),
        "aims": {"overhead_ms": AIM_MS, "share_of_own_rate": 0.9},
        "effort": {"repetitions": repetitions, "requests": requests, "seconds": seconds, "compute_ms": COMPUTE_MS},
        "overhead_ms": overheads,
        "requests_per_second": rates,
        "others_share_of_cores": common.spread(noise) if noise else None,
    }
    print(report(body))
    common.write_result(options.output, "remote_overhead", body)
    print(f"\nwritten: {options.output}")
    return 0


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    raise SystemExit(main())
