"""Wordings of drawers in a fridge, and of racks."""

from robocasa_lerobot.envs.wording.words import say

DRAWERS_AND_RACKS = {
    "OpenFridgeDrawer": say(
        "Pull the fridge drawer out all the way.",
        "The half-open drawer in the fridge should be fully out.",
        "Slide the drawer of the refrigerator further open.",
        "Draw the vegetable drawer in the fridge towards you.",
        "Get the fridge drawer completely open.",
    ),
    "CloseFridgeDrawer": say(
        "Push the drawer in the fridge shut.",
        "Slide the refrigerator's drawer back.",
        "The drawer inside the fridge should be closed.",
        "Put the fridge drawer back to where it belongs.",
        "No part of the fridge drawer should stick out.",
    ),
    "SlideDishwasherRack": say(
        "{verb} the top rack of the dishwasher all the way {direction}.",
        "Make the upper dishwasher rack go {direction} completely.",
        "The dishwasher's top rack should be all the way {direction}.",
        "Slide the upper basket of the dishwasher {direction} until it stops.",
        "Move the dishwasher's upper rack {direction}.",
    ),
    "SlideOvenRack": say(
        "{verb} the {rack} rack of the oven all the way {direction}.",
        "Make the oven's {rack} rack go {direction} completely.",
        "The {rack} rack in the oven should be all the way {direction}.",
        "Slide the {rack} grid of the oven {direction} until it stops.",
        "Move the oven's {rack} rack {direction}.",
    ),
    "SlideToasterOvenRack": say(
        "{verb} the {rack} of the toaster oven all the way {direction}.",
        "Make the toaster oven's {rack} go {direction} completely.",
        "The {rack} in the toaster oven should be all the way {direction}.",
        "Slide the {rack} of the toaster oven {direction} until it stops.",
        "Move the toaster oven's {rack} {direction}.",
    ),
}
