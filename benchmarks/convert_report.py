"""The conversion benchmark's figures as text, and the ratios, computed from its result alone."""

from __future__ import annotations

from typing import Any

import common

PROCESSES = (1, 2)
# What is measured, in the order of the table. LeRobot's way and the official one know one process only.
ROWS: dict[str, str] = {
    "images_ours_1": "ours, 1 worker",
    "images_ours_2": "ours, 2 workers",
    "images_lerobot": "LeRobot, default settings",
    "images_lerobot_alike": "LeRobot, our codec, pictures straight to the encoder",
    "images_encoder_1": "encoder alone, 1 process",
    "images_encoder_2": "encoder alone, 2 processes",
    "states_ours_1": "ours, 1 worker",
    "states_ours_2": "ours, 2 workers",
    "states_lerobot": "rendering, then LeRobot's way",
    "states_renderer_1": "renderer alone, 1 process",
    "states_renderer_2": "renderer alone, 2 processes",
    "states_scenes_1": "renderer alone and opening scenes, 1 process",
    "states_scenes_2": "renderer alone and opening scenes, 2 processes",
    "small_ours_1": "ours, 1 worker",
    "small_ours_2": "ours, 2 workers",
    "lift_ours_1": "ours, 1 worker",
    "lift_ours_2": "ours, 2 workers",
    "lift_ours_quality": "ours, 1 worker, shadows as in robosuite",
    "lift_official": "official method",
    "decode_ours": "our dataset",
    "decode_lerobot": "LeRobot's own recording",
}
SECTIONS: dict[str, str] = {
    "images": "pictures in the file",
    "states": "states only",
    "small": "states only, 64 pixels",
    "lift": "robosuite's Lift, states only",
    "decode": "random access, batches of 16",
}
# Of what, over what, and how much was promised (None: for information). Rates of the same number of processes are
# compared with each other; LeRobot's and the official way, which have one, with both of ours.
RATIOS: dict[str, tuple[str, str, float | None]] = {
    "images_of_encoder": ("images_ours_1", "images_encoder_1", 0.8),
    "images_of_encoder_2": ("images_ours_2", "images_encoder_2", 0.8),
    "images_vs_lerobot": ("images_ours_1", "images_lerobot", 5.0),
    "images_vs_lerobot_2": ("images_ours_2", "images_lerobot", 5.0),
    "images_vs_lerobot_alike": ("images_ours_1", "images_lerobot_alike", None),
    "states_of_renderer": ("states_ours_1", "states_renderer_1", 0.9),
    "states_of_renderer_2": ("states_ours_2", "states_renderer_2", 0.9),
    "states_of_scenes": ("states_ours_1", "states_scenes_1", None),
    "states_of_scenes_2": ("states_ours_2", "states_scenes_2", None),
    "states_vs_lerobot": ("states_ours_1", "states_lerobot", 3.0),
    "states_vs_lerobot_2": ("states_ours_2", "states_lerobot", 3.0),
    "lift_vs_official": ("lift_ours_1", "lift_official", 3.0),
    "lift_vs_official_2": ("lift_ours_2", "lift_official", 3.0),
    "lift_quality_vs_official": ("lift_ours_quality", "lift_official", None),
    "decode_vs_lerobot": ("decode_ours", "decode_lerobot", 1.0),
}
MEMORY_RATIO, MEMORY_TARGET = "memory_most_of_fewest", 1.1


def ratios(rates: dict[str, Any], memory: dict[str, Any]) -> dict[str, float]:
    """Medians over medians; the memory's is its peak with the most episodes over that with the fewest."""
    found = {
        name: rates[ours]["median"] / rates[other]["median"]
        for name, (ours, other, _) in RATIOS.items()
        if ours in rates and other in rates
    }
    if memory:
        counts = sorted(memory, key=int)
        found[MEMORY_RATIO] = memory[counts[-1]]["peak_mib"] / memory[counts[0]]["peak_mib"]
    return found


def met(name: str, ratio: float) -> bool | None:
    """Whether a ratio is what was promised; None where nothing was."""
    if name == MEMORY_RATIO:
        return ratio <= MEMORY_TARGET
    target = RATIOS[name][2]
    return None if target is None else ratio >= target


def report(body: dict[str, Any]) -> str:
    """All tables."""
    parts = [_rates(body), _ratios(body), _commands(body), _memory(body), _startup(body), _sizes(body), _noise(body)]
    return "\n" + "\n\n".join(part for part in parts if part)


def _rates(body: dict[str, Any]) -> str:
    rates, cpu = body["frames_per_second"], body["cpu_ms_per_step"]
    rows = [
        [f"{SECTIONS[key.partition('_')[0]]}: {words}",
         *(f"{rates[key][word]:.1f}" for word in ("median", "min", "max")), str(len(rates[key]["values"])),
         f"{cpu[key]['median']:.1f}" if key in cpu else ""]
        for key, words in ROWS.items()
        if key in rates
    ]  # fmt: skip
    return common.table(["steps/s (three pictures each)", "median", "min", "max", "runs", "CPU ms/step"], rows)


def _ratios(body: dict[str, Any]) -> str:
    rows = []
    for name, ratio in body["ratios"].items():
        if name == MEMORY_RATIO:
            target: str = f"<= {MEMORY_TARGET:g}"
        else:
            wanted = RATIOS[name][2]
            target = "" if wanted is None else f">= {wanted:g}"
        judged = {True: "met", False: "NOT MET", None: ""}[met(name, ratio)]
        rows.append([name, f"{ratio:.2f}", target, judged])
    return common.table(["ratio", "", "wanted", ""], rows)


def _commands(body: dict[str, Any]) -> str:
    rows = [
        [f"{key.rpartition('_')[0]}, {key.rpartition('_')[2]} process(es)", f"{run['seconds']:.1f}",
         f"{run['frames'] / run['seconds']:.1f}", f"{run['peak_mib']:.0f}", str(run["processes"])]
        for key, run in body.get("commands", {}).items()
    ]  # fmt: skip
    header = ["the whole command, imports included", "s", "steps/s", "peak MiB", "processes"]
    return common.table(header, rows) if rows else ""


def _memory(body: dict[str, Any]) -> str:
    rows = [
        [f"{count} episodes", f"{run['peak_mib']:.0f}", f"{run['seconds']:.1f}"]
        for count, run in body["memory"].items()
    ]
    return common.table(["memory, 1 process", "peak MiB", "s"], rows) if rows else ""


def _startup(body: dict[str, Any]) -> str:
    startup, loading = body.get("startup"), body["scene_loading"]
    starting = startup and (
        f"Not in the rates: start of a process with its imports {startup['process_s']:.1f} s; start of two workers, "
        f"once in a conversion with several processes, {startup['two_workers_s']:.1f} s."
    )
    lines = [
        *([starting] if starting else []),
        f"In ours, not in the renderer's: opening the scenes, {1000 * loading['seconds_per_demo']:.0f} ms a demo, "
        f"{100 * loading['share_of_drawing']:.1f} % of the drawing.",
    ]
    return "\n".join(lines)


def _sizes(body: dict[str, Any]) -> str:
    sizes = body["dataset_mib"]
    words = ", ".join(f"{ROWS.get(key, key)} ({key.partition('_')[0]}) {size:.1f}" for key, size in sizes.items())
    return f"Written, MiB: {words}."


def _noise(body: dict[str, Any]) -> str:
    noise = body["others_share_of_cores"]
    if noise is None or noise["max"] <= common.QUIET_SHARE:
        return ""
    return (
        f"NOT QUIET: between measurements others used {100 * noise['median']:.0f} % of the cores "
        f"(up to {100 * noise['max']:.0f} %). Figures of such a run are worth little: end other work and repeat."
    )
