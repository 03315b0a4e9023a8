"""The training benchmark's figures as text, and the ratios, computed from its result alone."""

from __future__ import annotations

from typing import Any

import common

LEROBOT, SAME_LOADER, DECODING, CACHED = "lerobot", "same_loader", "decoding", "cached"
WORDS = {
    LEROBOT: "lerobot-train",
    SAME_LOADER: "our loop, LeRobot's loader",
    DECODING: "our loop, our loader, decoding videos",
    CACHED: "our loop, our loader, cached frames",
}
# What over `lerobot-train`, and how much was promised (None: for information).
PROMISED: dict[str, float | None] = {SAME_LOADER: 1.0, DECODING: None, CACHED: 1.3}
LOADER_WORDS = {LEROBOT: "LeRobot's", DECODING: "ours, decoding videos", CACHED: "ours, cached frames"}
WAITING = 0.10  # of the time at most, on a GPU


def ratios(training: dict[str, Any], loaders: dict[str, Any]) -> dict[str, float]:
    """Medians over medians: `<policy>_<side>` over `lerobot-train`, `loader_<windows>_<kind>` over LeRobot's loader.

    Each kind counts with the number of loader processes that suits it best, except that the loop on LeRobot's loader
    has as many as `lerobot-train`: that one is about the loop alone.
    """
    found = {}
    for policy, measured in training.items():
        peer = best(measured, LEROBOT)
        if peer is None:
            continue
        for kind in PROMISED:
            workers = peer.rpartition("_")[2]
            ours = f"{kind}_{workers}" if kind == SAME_LOADER else best(measured, kind)
            if ours in measured:
                found[f"{policy}_{kind}"] = _rate(measured[ours]) / _rate(measured[peer])
    for windows, by_kind in loaders.items():
        for kind in (DECODING, CACHED):
            if kind in by_kind and LEROBOT in by_kind:
                found[f"loader_{windows}_{kind}"] = by_kind[kind]["median"] / by_kind[LEROBOT]["median"]
    return found


def best(measured: dict[str, Any], kind: str) -> str | None:
    """The fastest side of a kind."""
    keys = [key for key in measured if key.rpartition("_")[0] == kind]
    return max(keys, key=lambda key: _rate(measured[key])) if keys else None


def promised(name: str) -> float | None:
    """What a ratio should at least be; None where nothing was promised."""
    if name.startswith("loader_"):
        return None
    return next((least for kind, least in PROMISED.items() if name.endswith(f"_{kind}")), None)


def report(body: dict[str, Any]) -> str:
    """All tables."""
    parts = [_training(body), _loaders(body), _ratios(body), _notes(body)]
    return "\n" + "\n\n".join(part for part in parts if part)


def _training(body: dict[str, Any]) -> str:
    rows = []
    for policy, measured in body["training"].items():
        for key, side in measured.items():
            kind, _, workers = key.rpartition("_")
            rate = side["samples_per_second"]
            rows.append(
                [f"{policy}: {WORDS[kind]}, {workers} loader process(es)",
                 *(f"{rate[word]:.1f}" for word in ("median", "min", "max")), str(len(rate["values"])),
                 f"{100 * side['data_share']['median']:.1f}", f"{side['loss']['median']:.3f}"]
            )  # fmt: skip
    header = ["training, samples/s", "median", "min", "max", "runs", "waits for data, %", "loss"]
    return common.table(header, rows) if rows else ""


def _loaders(body: dict[str, Any]) -> str:
    rows = []
    for windows, by_kind in body["loaders"].items():
        observations, chunk = windows.split("x")
        for kind, rate in by_kind.items():
            name = f"{observations} observation(s), {chunk} actions: {LOADER_WORDS[kind]}"
            rows.append([name, *(f"{rate[word]:.1f}" for word in ("median", "min", "max")), str(len(rate["values"]))])
    return common.table(["loader alone, samples/s", "median", "min", "max", "runs"], rows) if rows else ""


def _ratios(body: dict[str, Any]) -> str:
    rows = []
    for name, ratio in body["ratios"].items():
        wanted = promised(name)
        judged = "" if wanted is None else "met" if ratio >= wanted else "NOT MET"
        rows.append([name, f"{ratio:.2f}", "" if wanted is None else f">= {wanted:g}", judged])
    return common.table(["ratio, ours over LeRobot's", "", "wanted", ""], rows) if rows else ""


def _notes(body: dict[str, Any]) -> str:
    data = body["dataset"]
    lines = [
        f"{data['kind']} dataset: {data['episodes']} episodes, {data['frames']} frames; batches of "
        f"{body['effort']['batch_size']} where no other number stands, on {body['device']}. "
        f"LeRobot decodes with {body['lerobot_decodes_with']}"
        + (", since torchcodec finds no FFmpeg." if body["lerobot_decodes_with"] == "pyav" else ".")
    ]
    if body["device"] != "cpu":
        for policy, measured in body["training"].items():
            side = best(measured, CACHED)
            if side is not None:
                share = measured[side]["data_share"]["median"]
                judged = "met" if share <= WAITING else "NOT MET"
                lines.append(
                    f"{policy}: our loop waits {share:.1%} of the time (wanted: at most {WAITING:.0%}), {judged}."
                )
    noise = body["others_share_of_cores"]
    if noise is not None:
        loud = "" if noise["median"] <= common.QUIET_SHARE else " NOT QUIET: these figures do not count."
        lines.append(f"Others took {noise['median']:.1%} of all cores (most: {noise['max']:.1%}).{loud}")
    return "\n".join(lines)


def _rate(side: dict[str, Any]) -> float:
    return float(side["samples_per_second"]["median"])
