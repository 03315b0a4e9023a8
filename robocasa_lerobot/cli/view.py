"""`robocasa-lerobot view`: a task's scene in MuJoCo's viewer, in a window or, with `--web`, in a browser."""

from __future__ import annotations

import argparse

EXAMPLE = "robocasa-lerobot view --task OpenDrawer --split pretrain --seed 3 --web"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("--task", default="PickPlaceCounterToSink", help="task name (default %(default)s)")
    parser.add_argument("--split", default="target", help="kitchens: target or pretrain (default target)")
    parser.add_argument("--seed", type=int, default=0, help="of the scene (default 0)")
    parser.add_argument("--layout", type=int, help="layout id, with --style, instead of the split's choice")
    parser.add_argument("--style", type=int, help="style id, with --layout")
    parser.add_argument("--web", action="store_true", help="in a browser: needs no display here, works over ssh")
    parser.add_argument("--port", type=int, default=0, help="with --web (default: the first free one from 8080 on)")


def run(args: argparse.Namespace) -> int:
    """Open the viewer and let the scene run until its window is closed, or the command interrupted."""
    import os
    import sys

    import numpy as np

    from robocasa_lerobot.envs.scene.build import build_scene
    from robocasa_lerobot.envs.tasks.registry import get_task
    from robocasa_lerobot.errors import UserError

    if (args.layout is None) != (args.style is None):
        raise UserError("--layout and --style belong together: give both, or neither.")
    task = get_task(args.task)
    if (
        not args.web
        and sys.platform.startswith("linux")
        and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    ):
        raise UserError(
            "there is no display here (neither DISPLAY nor WAYLAND_DISPLAY is set): add --web to see it in a browser, "
            "or use `robocasa-lerobot gallery`, which makes pictures."
        )
    kitchens = None if args.layout is None else [(args.layout, args.style)]
    scene = build_scene(task, args.split, args.seed, kitchens=kitchens)
    data, _ = scene.initial_data(np.random.default_rng(args.seed))
    print(f"layout {scene.layout_id}, style {scene.style_id}: {scene.instruction}")
    if args.web:
        from robocasa_lerobot.envs.web_view import WebView

        with WebView(f"{task.name}: {scene.instruction}", args.port, simulate=True) as view:
            tunnel = f"ssh -L {view.port}:127.0.0.1:{view.port} HERE"
            print(f"Open {view.address} in a browser on this machine; on another one run `{tunnel}` first.")
            print("The first picture takes a while. Ctrl+C ends it.", flush=True)
            view.run(scene.model, data)
        return 0
    import mujoco.viewer

    from robocasa_lerobot.envs.web_view import as_shown

    mujoco.viewer.launch(as_shown(scene.model), data)
    return 0
