"""What each kind of object looks like: one function per form, by family; importing them registers them."""

from robocasa_lerobot.envs.scene.objects.forms import (
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

__all__ = [
    "bakery",
    "bottles",
    "bunches",
    "crockery",
    "cutlery",
    "dishes",
    "fruit",
    "meat",
    "packages",
    "pouring",
    "sweets",
    "tools",
    "vegetables",
    "vessels",
]
