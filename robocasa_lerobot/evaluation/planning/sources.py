"""The policies of an evaluation: checkpoints are read, servers are asked, and all agree on one size of pictures."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource, common_image_size, label_of, read_source
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig, RemoteSettings, output_folder
from robocasa_lerobot.evaluation.records.results import TRIALS_FILE, RunHeader, file_name, read_results
from robocasa_lerobot.evaluation.remote.address import Address, is_address, parse_address
from robocasa_lerobot.evaluation.remote.client import Timeouts
from robocasa_lerobot.evaluation.remote.introduction import Introduction, RemotePolicy

Described = Mapping[str, Any]  # what a header says of a policy behind a socket


def open_sources(config: EvaluationConfig, ask: bool = True) -> tuple[list[PolicySource], int]:
    """The policies that the settings name, in their order, and the pixels at which the env renders.

    Servers are asked once, which is where mistakes in their key maps come up. Without `ask`, what the headers in the
    output folder say of them counts.

    Raises:
        UserError: a folder that is no checkpoint, a server that cannot be reached or whose first answer does not fit,
            pictures of different sizes.
    """
    policy = config.policy
    labels: list[str | None] = [*policy.label] or [None] * len(policy.path)
    remotes = sum(map(is_address, policy.path))
    given: list[str | None] = [*policy.keys] or [None]
    keys = iter(given if len(given) == remotes else given * remotes)
    recorded = {} if ask or not remotes else _recorded_remotes(output_folder(config, known_labels(config)))
    sources: list[PolicySource] = []
    asked: dict[int, Introduction] = {}
    with ExitStack() as stack:
        for place, (path, label) in enumerate(zip(policy.path, labels, strict=True)):
            if not is_address(path):
                sources.append(read_source(path, label, config.env.is_foreign))
                continue
            address, key_map = parse_address(path), next(keys)
            label = label or default_label(address)
            if not ask:
                sources.append(_known(label, _recorded(label, address, recorded)))
                continue
            patience = patience_of(config.remote)
            introduction = asked[place] = Introduction(address, key_map, config.executed_steps, patience)
            stack.callback(introduction.close)
            size = (introduction.image_size, introduction.image_size)
            sources.append(PolicySource(label, address.text, address.protocol, fingerprint="", image_size=size))
        image_size = common_image_size(sources, config.env.image_size)
        for place, introduction in asked.items():
            print(f"{sources[place].path}: a first request; some servers compile for minutes ...", file=sys.stderr)
            sources[place] = _known(sources[place].label, introduction.probe(image_size))
    return sources, image_size


def default_label(address: Address) -> str:
    """What a policy behind a socket is called, unless the user says."""
    return f"{address.protocol}-{address.host.strip('[]').replace(':', '-')}-{address.port}"


def patience_of(settings: RemoteSettings) -> Timeouts:
    """The settings as the clients take them."""
    return Timeouts(settings.connect_seconds, settings.answer_seconds, settings.first_answer_seconds)


def known_labels(config: EvaluationConfig) -> list[str]:
    """What the policies are called, as far as that is known: a checkpoint that is not there yet says nothing."""
    labels: Sequence[str | None] = config.policy.label or [
        default_label(parse_address(path)) if is_address(path) else label_of(path) for path in config.policy.path
    ]
    return [label for label in labels if label is not None]


def check_labels(labels: Iterable[str]) -> None:
    """Check the names of policies, which name folders as well.

    Raises:
        UserError: an empty or hidden one, or two that are the same, or would have one folder of films.
    """
    found: dict[str, str] = {}
    for label in labels:
        other = found.get(file_name(label))
        if other == label:
            raise UserError(f"two policies are called {label!r}: name them with --policy.label=A,B.")
        if other is not None:
            raise UserError(f"policy.label: {other!r} and {label!r} would have one folder; name one of them otherwise.")
        if not label or label.startswith("."):
            raise UserError(f"policy.label {label!r}: it names a folder, so it is not empty and has no leading '.'.")
        found[file_name(label)] = label


def recorded_device(out: Path) -> str | None:
    """What the checkpoints of the results in a folder, or of its shards, computed on; None where there are none."""
    return next((header.device for header in _recorded_headers(out) if header.has_checkpoints), None)


def _recorded_remotes(out: Path) -> dict[tuple[str, str], Described]:
    """What the headers in a results folder and in those of its shards say of policies behind sockets.

    By label and address: one server may be asked through two key maps.
    """
    found: dict[tuple[str, str], Described] = {}
    for header in _recorded_headers(out):
        known = header.policies.items()
        found |= {(label, info.path): info.remote for label, info in known if info.remote is not None}
    return found


def _recorded_headers(out: Path) -> Iterator[RunHeader]:
    for file in sorted(out.glob(f"**/{TRIALS_FILE}")):  # shards come first
        yield from read_results(file).headers.values()


def _recorded(label: str, address: Address, recorded: Mapping[tuple[str, str], Described]) -> RemotePolicy:
    if (label, address.text) not in recorded:
        known = ", ".join(f"{name} ({where})" for name, where in recorded)
        raise UserError(f"no results of a run with {label} ({address.text}); found {known or 'none'}.")
    return RemotePolicy.recorded(address, recorded[label, address.text])


def _known(label: str, remote: RemotePolicy) -> PolicySource:
    size = (remote.key_map.image_size, remote.key_map.image_size)
    text = remote.address.text
    return PolicySource(label, text, remote.address.protocol, remote.fingerprint, image_size=size, remote=remote)
