"""One page of all of the benchmark's tasks: a picture of the start, a film strip, words, sets and rates."""
