"""The designs of every category that models are drawn from.

Counts by category are those of RoboCasa365: 456 models in 12 categories.
"""

from __future__ import annotations

from robocasa_lerobot.envs.kitchens.appliances.families_built_in import BUILT_IN
from robocasa_lerobot.envs.kitchens.appliances.families_counter_top import COUNTER_TOP
from robocasa_lerobot.envs.kitchens.appliances.kind_record import Kind

KINDS: tuple[Kind, ...] = tuple(sorted((*BUILT_IN, *COUNTER_TOP), key=lambda kind: kind.name))
