"""The simulator benchmark's figures as text, and the ratios, computed from its result alone."""

from __future__ import annotations

from typing import Any

import common

PEER, OURS = "robosuite", "ours"
# Key of a figure, with cameras or not, processes at the same time, whether base and torso are left alone.
CONFIGURATIONS: tuple[tuple[str, bool, int, bool], ...] = (
    ("steps_no_cameras", False, 1, False),
    ("steps_three_cameras", True, 1, False),
    ("steps_three_cameras_standing", True, 1, True),
    ("steps_no_cameras_2_processes", False, 2, False),
    ("steps_three_cameras_2_processes", True, 2, False),
)
# What was promised, on a machine with two cores: times robosuite's steps, and seconds of a reset.
RATIO_TARGETS = {"steps_no_cameras": 7.0, "steps_three_cameras": 28.0, "steps_three_cameras_standing": 40.0}
RESET_TARGETS_S = {"new_scene": 1.0, "same_scene": 0.050}

MODEL_WORDS = ("geoms", "dofs", "bodies", "doors", "drawers", "other_hinges", "objects")


def ratios(steps: dict[str, Any]) -> dict[str, float]:
    """Our median control steps per second over robosuite's, by configuration; empty where only we ran."""
    if PEER not in steps:
        return {}
    return {key: steps[OURS][key]["median"] / steps[PEER][key]["median"] for key, *_ in CONFIGURATIONS}


def report(body: dict[str, Any]) -> str:
    """All tables."""
    parts = [_steps(body), _split(body), _resets(body), _memory(body), _models(body), _noise(body)]
    return "\n" + "\n\n".join(part for part in parts if part)


def _names(body: dict[str, Any]) -> list[str]:
    return [name for name in (PEER, OURS) if name in body["steps_per_second"]]


def _steps(body: dict[str, Any]) -> str:
    steps = body["steps_per_second"]
    names = _names(body)
    rows = []
    for key, cameras, processes, standing in CONFIGURATIONS:
        how = f"{'three 256x256 cameras' if cameras else 'no cameras'}{', base standing' * standing}"
        row = [f"{how}, {processes} process{'es' * (processes > 1)}"]
        row += [_between(steps[name][key], 1.0) for name in names]
        if body["ratios"]:
            ratio, target = body["ratios"][key], RATIO_TARGETS.get(key)
            row += [f"{ratio:.1f}x", "" if target is None else _judged(ratio >= target, f">= {target:g}x")]
        rows.append(row)
    header = ["control steps/s: median (min-max)", *names, *(["ratio", "wanted"] if body["ratios"] else [])]
    return common.table(header, rows)


def _split(body: dict[str, Any]) -> str:
    split = body["split_of_our_step"]
    parts = ("physics_s", "control_s", "python_s", "rendering_s")
    rows = [
        [key.removesuffix("_s"), f"{1000 * split[key]:.3f}", _share(split[key], split["step_s"]),
         "" if key == "rendering_s" else _share(split[key], split["step_without_pictures_s"])]
        for key in parts
    ]  # fmt: skip
    rows.append(["together", *(f"{1000 * split['step_s']:.3f}", "100 %", "100 %")])
    return common.table(["our control step", "ms", "with cameras", "without"], rows)


def _resets(body: dict[str, Any]) -> str:
    names = _names(body)
    first = body["envs"]
    rows = []
    rows.append(
        ["start of the program, imports", *(f"{1000 * first[n]['no_cameras']['startup_s']:.0f}" for n in names), ""]
    )
    for cameras in ("no_cameras", "three_cameras"):
        words = cameras.replace("_", " ")
        values = [
            f"{1000 * (first[n][cameras]['construct_s'] + first[n][cameras]['first_reset_s']):.0f}" for n in names
        ]
        rows.append([f"first in a process, {words}", *values, ""])
        for kind, target in RESET_TARGETS_S.items():
            spreads = [body["reset_seconds"][name][f"{kind}_{cameras}"] for name in names]
            met = body["reset_seconds"][OURS][f"{kind}_{cameras}"]["max"] < target
            judged = _judged(met, f"< {1000 * target:.0f}")
            rows.append([f"{kind.replace('_', ' ')}, {words}", *(_between(s, 1000.0) for s in spreads), judged])
    return common.table(["reset, ms: median (min-max)", *names, "wanted of ours"], rows)


def _memory(body: dict[str, Any]) -> str:
    names = _names(body)
    rows = []
    for cameras in ("no_cameras", "three_cameras"):
        envs = [body["envs"][name][cameras] for name in names]
        words = cameras.replace("_", " ")
        rows.append([f"process with one env, {words}", *(f"{env['resident_mib']:.0f}" for env in envs)])
        of_it = [env["resident_mib"] - env["resident_after_import_mib"] for env in envs]
        rows.append([f"  of it more than the imports, {words}", *(f"{value:.0f}" for value in of_it)])
        growth = [body["reset_seconds"][name][f"new_scene_{cameras}"]["growth_mib"] for name in names]
        rows.append([f"  growth per new scene, {words}", *(f"{value:.1f}" for value in growth)])
    return common.table(["memory, MiB resident", *names], rows)


def _models(body: dict[str, Any]) -> str:
    rows = []
    for name in _names(body):
        env = body["envs"][name]["three_cameras"]
        versions = ", ".join(f"{k} {v}" for k, v in env["versions"].items() if k in ("robosuite", "mujoco"))
        rows.append([f"{name}: {env['env']} ({versions})", *(str(env["model"][word]) for word in MODEL_WORDS)])
    cameras = [f"{name}: {', '.join(body['envs'][name]['three_cameras']['cameras'])}" for name in _names(body)]
    return common.table(["env", *(word.replace("_", " ") for word in MODEL_WORDS)], rows) + "\n" + "\n".join(cameras)


def _noise(body: dict[str, Any]) -> str:
    noise = body["others_share_of_cores"]
    if noise is None or noise["max"] <= common.QUIET_SHARE:
        return ""
    return (
        f"NOT QUIET: between measurements others used {100 * noise['median']:.0f} % of the cores "
        f"(up to {100 * noise['max']:.0f} %). Figures of such a run are worth little: end other work and repeat."
    )


def _between(spread: dict[str, Any], factor: float) -> str:
    values = [factor * spread[key] for key in ("median", "min", "max")]
    digits = 0 if values[0] >= 100 else 1 if values[0] >= 1 else 2
    return f"{values[0]:.{digits}f} ({values[1]:.{digits}f}-{values[2]:.{digits}f})"


def _share(part: float, whole: float) -> str:
    return f"{100 * part / whole:.0f} %"


def _judged(met: bool, target: str) -> str:
    return f"{target} {'met' if met else 'MISSED'}"
