"""What our own policies need, with a LeRobot that has none of its extras: see `policies/needs.py`.

Unlike any other module this one does something when it is imported: LeRobot stays without these packages in the whole
process. It is for the process that an evaluation's workers are forked from.
"""

import importlib

from robocasa_lerobot.evaluation.imports.policy_imports import LEROBOT_MODULES, POLICY_MODULES
from robocasa_lerobot.jobs.importing import left_out, rare_collections
from robocasa_lerobot.policies.needs import OTHERS_PACKAGES

with rare_collections():
    with left_out(OTHERS_PACKAGES):
        for _name in LEROBOT_MODULES:
            importlib.import_module(_name)
    for _name in POLICY_MODULES:
        importlib.import_module(_name)
