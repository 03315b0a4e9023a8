"""Run the training phases of an experiment file: `python train.py --config_path configs/experiments/demo.yaml`.

Settings can be changed on the command line, as in `--phases.pretrain.steps=100`; the same command again goes on
where an interrupted run was. `python train.py --help` lists the options, `configs/README.md` the settings.
"""

import sys

from robocasa_lerobot.cli import main

if __name__ == "__main__":
    raise SystemExit(main(["train", *sys.argv[1:]], own_process=True))
