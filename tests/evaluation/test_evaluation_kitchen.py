"""The real kitchens through the worker processes."""

from __future__ import annotations

from pathlib import Path

import pytest

from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.records.results import TrialRecord
from robocasa_lerobot.evaluation.run import engine
from robocasa_lerobot.gl import ensure_gl
from robocasa_lerobot.video import FILM_SIZE, read_frames


def evaluate(out: Path, *changes: str) -> list[TrialRecord]:
    arguments = ["--policy.path=random", "--trials=2", "--env.horizon=12", "--env.image_size=64", f"--out={out}"]
    return engine.evaluate(engine.prepare(load_config(EvaluationConfig, [*arguments, *changes])))


@pytest.mark.costly
@pytest.mark.render
def test_a_kitchen_trial_goes_the_same_way_whatever_ran_before_it_and_filmed_or_not(tmp_path: Path) -> None:
    ensure_gl()
    # One worker runs a task's trials one after another in one env; two workers have an env each.
    one = evaluate(tmp_path / "one", "--env.tasks=OpenDrawer", "--workers=1", "--videos=0")
    two = evaluate(tmp_path / "two", "--env.tasks=OpenDrawer", "--workers=2", "--videos=1")
    assert [r.error for r in one + two] == [None] * 4
    assert [(r.seed, r.steps, r.trajectory, r.instruction, r.terms, r.layout_id, r.style_id) for r in one] == [
        (r.seed, r.steps, r.trajectory, r.instruction, r.terms, r.layout_id, r.style_id) for r in two
    ]
    assert one[0].steps == 12
    assert one[0].instruction
    assert one[0].layout_id is not None
    assert one[0].style_id is not None
    (frame,) = read_frames(tmp_path / "two" / str(two[0].video), [6])
    assert frame.shape == (FILM_SIZE, 3 * FILM_SIZE, 3)
    # Three different pictures with something on them.
    views = [frame[:, i * FILM_SIZE : (i + 1) * FILM_SIZE].astype(float) for i in range(3)]
    assert all(view.std() > 10 for view in views)
    assert all(abs(views[i] - views[j]).mean() > 5 for i, j in ((0, 1), (1, 2), (0, 2)))
