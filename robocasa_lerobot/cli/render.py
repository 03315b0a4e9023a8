"""`robocasa-lerobot render`: a dataset's episodes drawn again with other cameras, sizes or presets."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from robocasa_lerobot.cli.options import import_lerobot_leanly
from robocasa_lerobot.jobs.executors import add_options, execution_of

EXAMPLE = "robocasa-lerobot render data/demos --out data/demos_cotraining --camera-set cotraining"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("dataset", type=Path, metavar="DIR", help="LeRobotDataset v3.0 with extras (models and states)")
    parser.add_argument("--out", required=True, type=Path, help="folder of the new dataset; must not exist yet")
    parser.add_argument(
        "--cameras",
        type=lambda text: tuple(name.strip() for name in text.split(",") if name.strip()),
        metavar="A,B,C",
        help="cameras to render (default: the dataset's, and those that --cam-configs adds)",
    )
    parser.add_argument("--image-size", type=int, metavar="PIXELS", help="height and width (default: the dataset's)")
    parser.add_argument(
        "--render-preset",
        choices=("fast", "quality"),
        default="fast",
        help="fast has no shadows, reflections or multisampling (default: %(default)s)",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--camera-set", metavar="NAME", help="cameras moved to a set of the project, such as cotraining")
    where.add_argument(
        "--cam-configs",
        type=Path,
        metavar="FILE",
        help="YAML or JSON with cameras to move or add, in RoboCasa's form: name: {parent_body, pos, quat, "
        "camera_attribs: {fovy}}",
    )
    parser.add_argument("--video-codec", choices=("h264", "hevc", "av1"), default="h264", help="default: %(default)s")
    parser.add_argument(
        "--asset-root", action="append", default=[], metavar="DIR", help="where meshes and textures are (repeatable)"
    )
    parser.add_argument("--workers", type=int, help="processes (default: by the amount of work and cores)")
    add_options(parser)
    parser.add_argument("--overwrite", action="store_true", help="replace a dataset at --out")


def run(args: argparse.Namespace) -> int:
    """Render, and say what was written."""
    execution = execution_of(args)
    from robocasa_lerobot.convert.reading.inputs import check_dataset
    from robocasa_lerobot.convert.rerender.camera_configs import camera_set, read_camera_configs
    from robocasa_lerobot.convert.rerender.plan import RenderSettings

    check_dataset(args.dataset)
    configs = {}
    if args.camera_set is not None:
        configs = camera_set(args.camera_set)
    if args.cam_configs is not None:
        configs = read_camera_configs(args.cam_configs)
    settings = RenderSettings(
        cameras=args.cameras,
        image_size=args.image_size,
        render_preset=args.render_preset,
        video_codec=args.video_codec,
        cam_configs=json.dumps(configs, sort_keys=True),
        asset_roots=tuple(args.asset_root),
    )
    import_lerobot_leanly(args)
    from robocasa_lerobot.convert.rerender.work import render_dataset

    result = render_dataset(args.dataset, args.out, settings, args.workers, args.overwrite, execution)
    if isinstance(result, str):
        print(result)
        return 0
    cameras = ", ".join(result.cameras)
    print(f"{result.root}: {result.num_episodes} episodes, {result.num_frames} frames, cameras {cameras}")
    return 0
