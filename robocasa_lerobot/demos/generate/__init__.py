"""Generation: demonstrations in new scenes out of recorded ones, in the manner of MimicGen, with a base that drives."""
