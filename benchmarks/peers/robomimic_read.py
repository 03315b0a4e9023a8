"""robomimic's own loader and trainer on one of our files, run by robomimic's Python; prints what it found as JSON.

Usage: robomimic_read.py FILE STEPS
"""

from __future__ import annotations

import contextlib
import json
import sys
from typing import Any

KEYS = ["robot0_base_to_eef_pos", "robot0_base_to_eef_quat", "robot0_gripper_qpos"]
BATCH = 16


def read(path: str, steps: int) -> dict[str, Any]:
    """Load the file as robomimic does, and take `steps` steps of its behaviour cloning; gives the losses."""
    import torch
    from robomimic.algo import algo_factory
    from robomimic.config import config_factory
    from robomimic.utils import file_utils, obs_utils
    from robomimic.utils.dataset import SequenceDataset

    config = config_factory("bc")
    with config.values_unlocked():
        config.observation.modalities.obs.low_dim = KEYS
    obs_utils.initialize_obs_utils_with_config(config)
    shapes = file_utils.get_shape_metadata_from_dataset(path, all_obs_keys=config.all_obs_keys, verbose=False)
    dataset = SequenceDataset(
        path, obs_keys=KEYS, dataset_keys=["actions", "rewards", "dones"], load_next_obs=False, hdf5_use_swmr=False
    )
    torch.manual_seed(0)
    device = torch.device("cpu")
    model = algo_factory("bc", config, shapes["all_shapes"], shapes["ac_dim"], device)
    model.set_train()
    batches = torch.utils.data.DataLoader(dataset, batch_size=BATCH, shuffle=True, drop_last=True)
    losses: list[float] = []
    while len(losses) < steps:
        for batch in batches:
            prepared = model.postprocess_batch_for_training(model.process_batch_for_training(batch), None)
            losses.append(model.log_info(model.train_on_batch(prepared, epoch=1))["Loss"])
            if len(losses) == steps:
                break
    return {
        "env_name": file_utils.get_env_metadata_from_dataset(path)["env_name"],
        "action_size": shapes["ac_dim"],
        "demos": dataset.n_demos,
        "steps": len(dataset),
        "losses": losses,
    }


if __name__ == "__main__":
    with contextlib.redirect_stdout(sys.stderr):  # robomimic prints
        found = read(sys.argv[1], int(sys.argv[2]))
    print(json.dumps(found))
