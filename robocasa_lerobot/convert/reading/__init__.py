"""Files and datasets that are converted, read lazily and checked."""
