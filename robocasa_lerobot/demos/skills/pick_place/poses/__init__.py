"""Where an object may be put down: poses on counters, in and on other objects, in regions, on burners."""
