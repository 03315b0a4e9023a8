"""Trials that crash, hang, are killed or diverge in both of their attempts, and what is recorded of each."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robocasa_lerobot.evaluation.planning.trials import trial_seed
from robocasa_lerobot.evaluation.records.results import TrialRecord

FAULTS = {1: "crash", 5: "hang", 9: "sigkill", 14: "nan"}
REASONS = {
    "crash": ("crashed", "RuntimeError: the block fell off"),
    "hang": ("hung", "no progress for 3 s"),
    "sigkill": ("crashed", "ended by SIGKILL"),
    "nan": ("diverged", "proprioception is not finite after step 2"),
}


def assert_faults_cost_only_their_trials(
    evaluate: Callable[..., list[TrialRecord]],
    own: dict[str, Any],
    reasons: dict[str, tuple[str, str]],
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Evaluate without faults and with four, each in both attempts of a trial: all other records are the same.

    Args:
        evaluate: of a folder and settings, of the env that slides.
        own: settings of both runs, whose stall_seconds is 3.
        reasons: outcome and words of the error, for each kind of fault.
        folder: for both runs.
        monkeypatch: tells the env which seeds are faulty.
    """
    healthy = evaluate(folder / "healthy", **own)
    # Only trials that get to their second step can be faulty there.
    chosen = dict(zip([r.trial for r in healthy if r.steps > 2], FAULTS.values(), strict=False))
    assert len(chosen) == len(FAULTS)
    faulty = {str(trial_seed(0, "Slide", trial)): kind for trial, kind in chosen.items()}
    monkeypatch.setenv("SLIDE_FAULTY_SEEDS", json.dumps(faulty))
    records = evaluate(folder / "out", **own)
    assert len(records) == own["trials"]
    for record, well in zip(records, healthy, strict=True):
        if record.trial not in chosen:
            assert record.comparable() == well.comparable()
            continue
        outcome, words = reasons[chosen[record.trial]]
        assert (record.outcome, record.first_outcome, record.attempts) == (outcome, outcome, 2)
        assert words in str(record.error)
        assert words in str(record.first_error)
        assert not record.success
