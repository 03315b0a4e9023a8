"""What each kind of object looks like: one function per form, by family; importing them registers them."""

from robocasa_lerobot.envs.objects.draft import FORMS, Form
from robocasa_lerobot.envs.objects.forms import (
    bakery,
    bottles,
    bunches,
    crockery,
    cutlery,
    dishes,
    fruit,
    meat,
    packages,
    pouring,
    sweets,
    tools,
    vegetables,
    vessels,
)
from robocasa_lerobot.errors import UnknownNameError

__all__ = [
    "bakery",
    "bottles",
    "bunches",
    "crockery",
    "cutlery",
    "dishes",
    "find_form",
    "fruit",
    "meat",
    "packages",
    "pouring",
    "sweets",
    "tools",
    "vegetables",
    "vessels",
]


def find_form(name: str) -> Form:
    """The form of a name.

    Raises:
        UnknownNameError: there is none.
    """
    if name not in FORMS:
        raise UnknownNameError("form of objects", name, FORMS)
    return FORMS[name]
