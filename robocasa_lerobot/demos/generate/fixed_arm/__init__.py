"""Sources from other simulators: a Panda on a stand, as robosuite's own tasks have it, in the scene of its file."""
