"""`robocasa-lerobot serve`: answer others' evaluations with a policy, over the wire that they speak."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

EXAMPLE = (
    "robocasa-lerobot serve --policy.path=outputs/demo/finetune/checkpoints/last/pretrained_model"
    " --protocol=openpi --port=8000"
)
_PORTS = {"openpi": 8000, "gr00t": 5555, "vla_eval": 8000}  # those of the protocols' own servers


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from robocasa_lerobot.evaluation.config.evaluation import RUNTIMES, PolicySettings
    from robocasa_lerobot.serving.limits import Limits

    limits = Limits()
    policy = parser.add_argument_group("policy")
    policy.add_argument(
        "--policy.path", dest="path", required=True, metavar="DIR", help="a checkpoint, or `random`, or `zero`"
    )
    policy.add_argument("--policy.label", dest="label", metavar="NAME", help="its name in what clients are told")
    policy.add_argument("--policy.device", dest="device", default="auto", help="auto (default), cpu, cuda, cuda:1, mps")
    policy.add_argument("--policy.threads", dest="threads", type=int, default=1, help="CPU threads (default 1)")
    policy.add_argument(
        "--policy.batch_width",
        dest="width",
        type=int,
        default=0,
        help="observations that are computed at once; 0 (default): as an evaluation would",
    )
    policy.add_argument(
        "--policy.runtime",
        dest="runtime",
        choices=RUNTIMES,
        default=PolicySettings.runtime,
        help="what computes this project's own policies on a CPU; as in `eval` (default %(default)s)",
    )
    policy.add_argument("--executed-steps", type=int, help="actions of an answer (default: the policy's own)")
    policy.add_argument("--seed", type=int, default=0, help="of the noise where clients give no seed (default 0)")
    policy.add_argument("--resize", action="store_true", help="scale pictures of another size than the policy's")
    policy.add_argument(
        "--repeat-history", action="store_true", help="let one observation stand for a policy's whole history"
    )
    door = parser.add_argument_group("door")
    door.add_argument("--protocol", choices=tuple(_PORTS), default="openpi", help="default openpi")
    door.add_argument(
        "--host", default="127.0.0.1", help="address to listen on (default 127.0.0.1, this machine alone)"
    )
    door.add_argument("--port", type=int, help="default 8000; 5555 for gr00t; 0: any free one")
    door.add_argument(
        "--token-file",
        type=Path,
        metavar="FILE",
        help="what clients must send (or the environment's ROBOCASA_LEROBOT_POLICY_TOKEN); needed for any other host",
    )
    door.add_argument(
        "--max-message",
        type=float,
        default=limits.message_bytes / 2**20,
        metavar="MIB",
        help="largest message (default %(default)g MiB)",
    )
    door.add_argument("--max-clients", type=int, default=limits.clients, help="clients at a time (default %(default)s)")
    door.add_argument(
        "--groot-version", choices=("1.5", "1.6"), default="1.6", help="of gr00t's modality config (default 1.6)"
    )
    door.add_argument("--allow-kill", action="store_true", help="gr00t's clients may end the server")


def run(args: argparse.Namespace) -> int:
    """Load the policy and serve it until the process is told to end."""
    from robocasa_lerobot.errors import UserError
    from robocasa_lerobot.evaluation.actors.checkpoint import read_source
    from robocasa_lerobot.evaluation.remote.address import is_address
    from robocasa_lerobot.serving.access import make_access
    from robocasa_lerobot.serving.host import Host
    from robocasa_lerobot.serving.limits import Limits
    from robocasa_lerobot.serving.policy import load_served
    from robocasa_lerobot.serving.server import ServerSettings, address, run_server

    for name, number, low in (
        ("policy.threads", args.threads, 1),
        ("policy.batch_width", args.width, 0),
        ("executed-steps", args.executed_steps, 1),
        ("max-clients", args.max_clients, 1),
        ("seed", args.seed, 0),
    ):
        if number is not None and number < low:
            raise UserError(f"--{name}: found {number}, expected at least {low}.")
    if not 0 < args.max_message <= 1024:
        raise UserError(f"--max-message: found {args.max_message}, expected MiB above 0 and at most 1024.")
    if is_address(args.path):
        raise UserError(f"{args.path} is served already: give a checkpoint, random or zero.")
    port = _PORTS[args.protocol] if args.port is None else args.port
    settings = ServerSettings(
        args.protocol,
        make_access(args.host, port, args.token_file),
        Limits(int(args.max_message * 2**20), args.max_clients),
        args.groot_version,
        args.allow_kill,
    )
    policy = load_served(
        read_source(args.path, args.label), args.device, args.executed_steps, args.width, args.threads, args.runtime
    )
    host = Host(policy, args.seed, args.resize, args.repeat_history)

    def ready(bound: int) -> None:
        print(f"serving {policy.served.describe()} at {address(settings, bound)}; Ctrl-C ends it", flush=True)

    if run_server(host, settings, ready):
        print("the server has ended", flush=True)
        return 0
    print("the server has ended, and left a computation behind that did not", flush=True)
    os._exit(1)  # Python would wait for its threads
