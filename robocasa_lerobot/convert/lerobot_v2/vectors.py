"""What the numbers of a LeRobot v2 dataset's states and actions are, and in which order the contract wants them."""

from __future__ import annotations

from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.lerobot_v2.dataset import V2Dataset
from robocasa_lerobot.convert.lerobot_v2.episode import Column
from robocasa_lerobot.convert.reading.demo_file import SourceError


def named_vector(
    dataset: V2Dataset, column: Column, kind: str, contract_parts: tuple[Part, ...]
) -> tuple[Column, tuple[Part, ...]]:
    """Names of a vector's components: the contract's for its own robot, else the dataset's, else by its parts.

    Raises:
        SourceError: it is as long as the contract's, and nothing says in which order its components are.
    """
    slices = _modality_slices(dataset, column, kind)
    components = flat_names(dataset.features[column.name].get("names"), column.size)
    contract_sizes = {part.name: part.size for part in contract_parts}
    if dataset.robot_type == contract.ROBOT_TYPE and column.size == sum(contract_sizes.values()):
        names = tuple(contract.component_names(contract_parts))
        order: tuple[int, ...] | None = None
        if {name: stop - start for name, (start, stop) in slices.items()} == contract_sizes:
            order = tuple(i for part in contract_parts for i in range(*slices[part.name]))
        elif components is not None and set(components) == set(names):
            order = tuple(components.index(name) for name in names)
        elif components is None and not slices:
            # Ports of RoboCasa's HDF5 files have as many numbers in another order.
            raise SourceError(
                f"{dataset.root} does not say what the {column.size} numbers of {column.name!r} are: it has neither "
                f"meta/modality.json nor {column.size} `names` in meta/info.json. Put one of them there: RoboCasa's "
                f"own datasets have {', '.join(f'{part.name} {part.size}' for part in contract_parts)}, in this order."
            )
        if order is not None:
            changed = order if order != tuple(range(column.size)) else None
            return Column(column.name, column.dtype, column.size, names, changed), contract_parts
    if components is None and slices:
        components = [f"{name}_{i}" for name, (start, stop) in slices.items() for i in range(stop - start)]
    components = components or [f"{kind}_{i}" for i in range(column.size)]
    parts = tuple(Part(name, tuple(components[start:stop])) for name, (start, stop) in slices.items())
    return Column(column.name, column.dtype, column.size, tuple(components)), parts or (Part(kind, tuple(components)),)


def _modality_slices(dataset: V2Dataset, column: Column, kind: str) -> dict[str, tuple[int, int]]:
    """Part -> (start, stop) from `modality.json`, in order; empty unless the parts tile the vector without a gap."""
    section = dataset.modality.get(kind)
    found: list[tuple[int, int, str]] = []
    for name, part in section.items() if isinstance(section, dict) else ():
        if not isinstance(part, dict) or part.get("original_key", column.name) != column.name:
            continue
        start, stop = part.get("start"), part.get("end")
        if not isinstance(start, int) or not isinstance(stop, int):
            return {}
        found.append((start, stop, name))
    found.sort()
    edges = [0, *(stop for _, stop, _ in found)]
    tiled = all(start == edge for (start, _, _), edge in zip(found, edges, strict=False)) and edges[-1] == column.size
    return {name: (start, stop) for start, stop, name in found} if tiled else {}


def flat_names(names: Any, size: int) -> list[str] | None:
    """Names of the components of a vector as `info.json` has them, or None where it has no such list of that length."""
    if isinstance(names, dict) and len(names) == 1:  # {"motors": [...]}
        names = next(iter(names.values()))
    if isinstance(names, list) and len(names) == size and all(isinstance(name, str) for name in names):
        return names
    return None
