"""Where the objects of a task start: areas of counters, regions of fixtures, and putting them there."""
