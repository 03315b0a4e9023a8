"""How sure a result is: plain functions over counts and arrays, computed by scipy and statsmodels.

One question per file: `rates` (one task), `averages` (several tasks), `paired` (two policies on the same trials),
`power` (what so many trials can show), `horizon` (success against time), `lifelong` (the matrix of phases),
`data_efficiency` (how many demonstrations pretraining is worth), `progress` (how far trials come).
"""

from robocasa_lerobot.evaluation.statistics.averages import Estimate, average_over_tasks, linear_combination, ratio
from robocasa_lerobot.evaluation.statistics.rates import Rate, success_rate
from robocasa_lerobot.wilson import CONFIDENCE, wilson_interval

__all__ = [
    "CONFIDENCE",
    "Estimate",
    "Rate",
    "average_over_tasks",
    "linear_combination",
    "ratio",
    "success_rate",
    "wilson_interval",
]
