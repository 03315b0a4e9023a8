"""What an MJCF from a stranger may not do: open files by itself, expand without bound, or ask for absurd sizes.

Checked before MuJoCo sees the text, because its compiler allocates what the text asks for and cannot be interrupted.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from robocasa_lerobot.convert.reading.hdf5 import MAX_TEXT_BYTES, RejectedEpisodeError

# RoboCasa's kitchens have some 10,000 elements nested 30 deep; MuJoCo's own parser gives up at a depth of 500.
MAX_ELEMENTS = 1_000_000
MAX_DEPTH = 200
MAX_COPIES = 10_000  # bodies that <replicate>, <composite> and <flexcomp> make, nested ones multiplied
# Elements that make MuJoCo open further files or load libraries by itself.
FORBIDDEN = ("include", "attach", "extension", "plugin")
# The largest value of attributes whose product decides how much is allocated, by element.
_LIMITS: dict[str, tuple[tuple[str, ...], int]] = {
    "texture": (("width", "height"), 8192 * 8192),
    "hfield": (("nrow", "ncol"), 4096 * 4096),
    "numeric": (("size",), 1_000_000),
    "user": (("dim",), 1_000_000),
    "mesh": (("params",), 1_000_000),
}
_MULTIPLIERS = ("replicate", "composite", "flexcomp")
# Sizes of buffers that are no part of a picture: MuJoCo's own defaults, or those of the asked-for pictures, are taken.
_DROPPED: dict[str, tuple[str, ...]] = {
    "global": ("offwidth", "offheight"),
    "size": ("memory", "njmax", "nconmax", "nstack"),
}
_MAX_QUALITY = 8192  # <quality shadowsize> and the like
_MAX_USER_VALUES = 1000  # <size nuser_*> numbers for each element of a kind


def parse_mjcf(xml: str) -> ET.Element:
    """The root element of an MJCF.

    Raises:
        RejectedEpisodeError: it is not XML, declares entities, or is absurdly long, deep or rich in elements.
    """
    if len(xml) > MAX_TEXT_BYTES or xml.count("<") > 2 * MAX_ELEMENTS:
        raise RejectedEpisodeError(f"its model_file has {len(xml)} characters, which is no scene of a demonstration.")
    # Entity declarations are of no use in an MJCF, and can expand without bound.
    if "<!DOCTYPE" in xml or "<!ENTITY" in xml:
        raise RejectedEpisodeError("its model_file declares XML entities.")
    try:
        root = ET.fromstring(xml)
    except (ET.ParseError, ValueError, RecursionError) as error:
        raise RejectedEpisodeError(f"its model_file is not XML ({error}).") from None
    if root.tag != "mujoco":
        raise RejectedEpisodeError(f"its model_file is a <{root.tag}> document, expected MJCF (<mujoco>).")
    level, depth = list(root), 1
    while level:
        depth += 1
        if depth > MAX_DEPTH:
            raise RejectedEpisodeError(f"its model_file nests elements more than {MAX_DEPTH} deep.")
        level = [child for element in level for child in element]
    return root


def check_limits(root: ET.Element, file_elements: tuple[str, ...]) -> None:
    """Refuse what MuJoCo would open or allocate on behalf of the text; drop sizes that no picture depends on.

    Args:
        root: a parsed MJCF, changed in place.
        file_elements: elements whose files are handed over in memory; no other may name a file.

    Raises:
        RejectedEpisodeError: an element that is not loaded from demonstrations, or an absurd size.
    """
    for element in root.iter():
        for attribute in _DROPPED.get(element.tag, ()):
            element.attrib.pop(attribute, None)
        names_file = any(key.startswith("file") and value for key, value in element.attrib.items())
        if element.tag in FORBIDDEN or (names_file and element.tag not in file_elements):
            raise RejectedEpisodeError(f"its model_file has a <{element.tag}> element, which is not loaded from demos.")
        if element.tag in _LIMITS:
            attributes, limit = _LIMITS[element.tag]
            _check_size(element, attributes, limit)
        if element.tag == "quality":
            for attribute in element.attrib:
                _check_size(element, (attribute,), _MAX_QUALITY)
        if element.tag == "size":
            _check_size(element, tuple(k for k in element.attrib if k.startswith("nuser_")), _MAX_USER_VALUES)
            _check_size(element, ("nuserdata", "nkey"), _LIMITS["numeric"][1])
    _check_copies(root)


def _check_copies(root: ET.Element) -> None:
    level = [(root, 1.0)]
    while level:
        deeper: list[tuple[ET.Element, float]] = []
        for element, copies in level:
            if element.tag in _MULTIPLIERS:
                copies *= max(1.0, _product(element.get("count", "1")))
                if not copies <= MAX_COPIES:
                    raise RejectedEpisodeError(f"its model_file multiplies bodies {copies:g} times (<{element.tag}>).")
            deeper.extend((child, copies) for child in element)
        level = deeper


def _check_size(element: ET.Element, attributes: tuple[str, ...], limit: int) -> None:
    size = math.prod(max(1.0, _product(element.get(attribute, "1"))) for attribute in attributes)
    if not size <= limit:
        asked = " ".join(f"{a}={element.get(a, '')[:40]!r}" for a in attributes if a in element.attrib)
        raise RejectedEpisodeError(f"its model_file asks for an absurd size: <{element.tag} {asked}>.")


def _product(text: str) -> float:
    """The product of the numbers in an attribute; what are no numbers MuJoCo refuses by itself."""
    product = 1.0
    for word in text.split():
        try:
            product *= max(1.0, abs(float(word)))
        except ValueError:
            return 1.0
    return product
