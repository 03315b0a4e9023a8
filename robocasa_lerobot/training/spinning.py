"""How long threads of a training on a CPU spin while they wait for each other."""

from __future__ import annotations

import os

# Seconds per training step on two cores: 0.13, against 0.15 with GNU's default, which spins almost without end
# (and takes ten times as long beside other work), and 0.17 with no spinning at all.
SPIN_COUNT = 20_000


def limit_spinning() -> None:
    """Let waiting OpenMP threads spin for a moment only, unless `GOMP_SPINCOUNT` says otherwise.

    OpenMP reads it when torch is loaded, so call this before; processes started later inherit it.
    """
    os.environ.setdefault("GOMP_SPINCOUNT", str(SPIN_COUNT))
