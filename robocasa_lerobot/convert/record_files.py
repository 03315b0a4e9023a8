"""Names of the files and folders that a conversion leaves beside the data: in a shard, and in the dataset."""

META_FOLDER = "meta/robocasa"
CONVERSION_FILE = "conversion.json"
ACTIONS_OUT_OF_RANGE = "actions_out_of_range"  # in it
DATASET, EXTRAS, ASSETS = "dataset", "extras", "assets"
EPISODES_FILE, REJECTED_FILE, HISTOGRAMS_FILE = "episodes.jsonl", "rejected.jsonl", "histograms.npz"


def episode_folder(index: int) -> str:
    """Name of an episode's folder under `extras`, as in RoboCasa's datasets."""
    return f"episode_{index:06d}"


def kept_assets(sha256: str) -> str:
    """Folder under `extras` with the meshes and textures that a source file held itself."""
    return f"{ASSETS}/{sha256[:12]}"
