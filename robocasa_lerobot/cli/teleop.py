"""`robocasa-lerobot teleop`: record demonstrations by hand, in a browser, or correct a policy while it drives."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robocasa_lerobot.teleop.loop import ControlLoop
    from robocasa_lerobot.teleop.server import TeleopServer

EXAMPLE = (
    "robocasa-lerobot teleop --task OpenDrawer --split pretrain --episodes 20 --out by_hand/\n"
    "  robocasa-lerobot teleop --task OpenDrawer --policy outputs/demo/finetune --episodes 10 --out corrections/"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("--task", required=True, help="name of the task")
    parser.add_argument(
        "--split",
        default="target",
        help="kitchens: target, pretrain, or of the latter pretrain_train and pretrain_val (default target)",
    )
    parser.add_argument("--episodes", type=int, default=20, help="saved episodes wanted in all (default 20)")
    parser.add_argument("--seed", type=int, default=0, help="of the first kitchen (default 0)")
    parser.add_argument(
        "--out", type=Path, required=True, help="folder that gets <task>.hdf5; the same command goes on"
    )
    parser.add_argument("--layout", type=int, metavar="ID", help="layout, or group of them, instead of the split's own")
    parser.add_argument("--style", type=int, metavar="ID", help="the same for styles")
    parser.add_argument("--operator", default="", help="name that is written into each episode")
    parser.add_argument("--hide-goal", action="store_true", help="do not show whether the goal's terms hold")
    parser.add_argument(
        "--image-size",
        type=int,
        default=256,
        help="height and width of the pictures that you see (default 256); a policy sees its own size",
    )
    parser.add_argument("--preset", default="fast", help="fast, or quality: with shadows (default fast)")
    parser.add_argument("--host", default="127.0.0.1", help="address to serve at (default 127.0.0.1, this machine)")
    parser.add_argument("--port", type=int, default=8765, help="port, 0 for a free one (default 8765)")
    parser.add_argument("--free-view", action="store_true", help="MuJoCo's own viewer in a second tab, on this machine")
    parser.add_argument(
        "--policy",
        default="",
        help="drives until you take over: a checkpoint folder, or a policy or address that `eval` takes",
    )
    parser.add_argument(
        "--policy-keys", default="", help="key map of a policy behind a socket, as eval's --policy.keys"
    )
    parser.add_argument(
        "--device", default="auto", help="that the policy computes on: auto (default), cpu, cuda, cuda:1, mps"
    )


def run(args: argparse.Namespace) -> int:
    """Serve until enough episodes are saved; status 1 where fewer are."""
    from robocasa_lerobot.teleop.run import Place, run_session
    from robocasa_lerobot.teleop.settings import TeleopSettings

    settings = TeleopSettings(
        task=args.task,
        out=args.out,
        split=args.split,
        episodes=args.episodes,
        seed=args.seed,
        layouts=None if args.layout is None else (args.layout,),
        styles=None if args.style is None else (args.style,),
        image_size=args.image_size,
        render_preset=args.preset,
        operator=args.operator,
        hide_goal=args.hide_goal,
    )
    outcome = run_session(
        settings,
        Place(args.host, args.port),
        _announce,
        policy=args.policy,
        device=args.device,
        keys=args.policy_keys,
        free_view=args.free_view,
    )
    where = f" in {outcome.path}" if outcome.path else ""
    print(f"{outcome.saved} of {args.episodes} episodes{where}")
    return 0 if outcome.saved >= args.episodes else 1


def _announce(server: TeleopServer, loop: ControlLoop) -> None:
    from robocasa_lerobot.serving.access import is_loopback

    print(f"open {server.address}", flush=True)
    if server.host in ("0.0.0.0", "::"):
        print(f"from another machine with the name or address of this one in place of {server.host}", flush=True)
    if not is_loopback(server.host):
        print("anybody who has this address can drive; nothing else is served", flush=True)
    elif "SSH_CONNECTION" in os.environ:
        machine = os.environ["SSH_CONNECTION"].split()[2]
        print(f"first, where your browser is: ssh -L {server.port}:127.0.0.1:{server.port} {machine}", flush=True)
    else:
        line = f"ssh -L {server.port}:127.0.0.1:{server.port} THIS_MACHINE"
        print(f"from another machine, first there: {line}", flush=True)
    if server.free_view:
        port = server.free_view.rstrip("/").rpartition(":")[2]
        print(f"MuJoCo's viewer: {server.free_view} (from another machine: ssh -L {port}:127.0.0.1:{port} as well)")
    print("Ctrl+C ends it; what is saved stays, and the same command goes on", flush=True)
