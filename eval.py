"""Evaluate policies: `python eval.py --policy.path=DIR --env.tasks=OpenDrawer --trials 10`; `--help` lists the rest.

The same as `robocasa-lerobot eval`. A YAML file of settings comes in with `--config_path`, for example
configs/evaluations/quick.yaml, and every setting can be given on the command line by its dotted name. Results go to
`--out`: trials.jsonl (one line for each trial, appended as it ends; the same command after a kill runs the missing
trials), videos/, and the report: report.html, .md, .tex and two .csv.
"""

from __future__ import annotations

import sys

from robocasa_lerobot.cli import main

# The guard matters: worker processes import this file again.
if __name__ == "__main__":
    raise SystemExit(main(["eval", *sys.argv[1:]], own_process=True))
