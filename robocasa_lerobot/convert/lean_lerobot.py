"""LeRobot's datasets, imported without what only its policies need.

Unlike any other module this one does something when it is imported: LeRobot stays without these packages in the whole
process. It is for processes that convert and do nothing else, and comes before all others there.
"""

from robocasa_lerobot.jobs.importing import POLICY_PACKAGES, left_out, rare_collections

with rare_collections(), left_out(POLICY_PACKAGES):
    import lerobot.datasets.lerobot_dataset  # noqa: F401
