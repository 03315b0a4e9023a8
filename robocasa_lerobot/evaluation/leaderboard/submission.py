"""A submission: the three group rates of a run with the facts that the leaderboard asks for."""

from __future__ import annotations

import datetime
import json
from dataclasses import dataclass, fields
from importlib import resources
from pathlib import Path
from typing import Any

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.leaderboard.protocol import reasons
from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report.policies import PolicyResult, average_of
from robocasa_lerobot.policies.origin import ORIGIN_FILE

NOT_AVAILABLE = "N/A"


class SubmissionError(UserError):
    """A run or its facts that the leaderboard would not take; every reason is named."""


@dataclass
class SubmissionFacts:
    """What no results file knows. None asks the run, or is written as "N/A" where the leaderboard allows it.

    model_name: how the model is called.
    policy_family: the kind of policy, e.g. "VLA" or "Diffusion Policy"; default: the policy's type.
    date: YYYY-MM-DD; default: today.
    submission_source: "external", or "internal" for RoboCasa's own team.
    open_source: "yes", or "no" (which means giving the RoboCasa team private access to checkpoint and code).
    batch_size: the global batch; default: from the train_config.json of a checkpoint that was trained here.
    num_training_steps: default: from the checkpoint's folder or its train_config.json.
    commit_hash: of the code that trained and evaluated; default: the run's.
    notes: added to the fixed ones: which simulator, trials, intervals.
    """

    model_name: str | None = None
    policy_family: str | None = None
    date: str | None = None
    submission_source: str = "external"
    open_source: str = "yes"
    code_url: str = NOT_AVAILABLE
    checkpoint_url: str = NOT_AVAILABLE
    paper_link: str = NOT_AVAILABLE
    commit_hash: str | None = None
    wandb: str | None = None
    batch_size: int | None = None
    num_training_steps: int | None = None
    notes: str = ""


def make_submission(policy: PolicyResult, facts: SubmissionFacts) -> dict[str, Any]:
    """The submission's JSON object, checked against the schema.

    Raises:
        SubmissionError: the run does not follow the protocol, or a fact is missing or of the wrong kind; all reasons.
    """
    found = reasons(policy)
    values: dict[str, Any] = {}
    if not found:
        values = _values(policy, facts)
        found = [*problems(values), *_of_one_process(policy, facts)]
    if found:
        raise SubmissionError("this run cannot be submitted:\n" + "\n".join(f"- {reason}" for reason in found))
    return values


def problems(values: Any) -> list[str]:
    """What the schema of the leaderboard's submissions finds wrong, a sentence each."""
    import jsonschema

    schema = json.loads(resources.files(__package__).joinpath("submission.schema.json").read_text(encoding="utf-8"))
    checker = jsonschema.Draft202012Validator(schema, format_checker=jsonschema.FormatChecker())
    errors = sorted(checker.iter_errors(values), key=lambda error: [str(part) for part in error.absolute_path])
    return [f"{_place(error)}{error.message}{_remedy(error)}" for error in errors]


def overall(values: dict[str, Any]) -> float:
    """The leaderboard's weighted average over the 50 tasks, percent with one decimal; it is never submitted itself."""
    total = sum(count * values[f"{group}_success"] for group, count in published.GROUPS.items())
    return float(round(total / sum(published.GROUPS.values()), 1))


def _values(policy: PolicyResult, facts: SubmissionFacts) -> dict[str, Any]:
    config = _train_config(Path(policy.info.path))
    batch_size = config.get("batch_size") if _trained_here(policy) else None
    versions = policy.header.versions
    values: dict[str, Any] = {
        "model_name": facts.model_name,
        "policy_family": facts.policy_family or policy.info.type,
        "date": facts.date or datetime.datetime.now(datetime.UTC).date().isoformat(),
        "submission_source": facts.submission_source,
        "robocasa_version": f"robocasa_lerobot {versions.get('robocasa_lerobot')} (not RoboCasa's simulator)",
        **{f"{group}_success": _percent(policy, group) for group in published.GROUPS},
        "code_url": facts.code_url,
        "commit_hash": facts.commit_hash or policy.header.git_commit or NOT_AVAILABLE,
        "checkpoint_url": facts.checkpoint_url,
        "paper_link": facts.paper_link,
        "open_source": facts.open_source,
        "training_config": {
            "batch_size": facts.batch_size if facts.batch_size is not None else batch_size,
            "num_training_steps": facts.num_training_steps
            if facts.num_training_steps is not None
            else policy.info.step or config.get("steps"),
        },
        "notes": _notes(policy, facts),
    }
    return values if facts.wandb is None else {**values, "wandb": facts.wandb}


def _percent(policy: PolicyResult, group: str) -> float:
    return round(100 * average_of(policy.group(group, UNPERTURBED)).value, 2)


def _notes(policy: PolicyResult, facts: SubmissionFacts) -> str:
    header = policy.header
    means = {group: average_of(policy.group(group, UNPERTURBED)) for group in published.GROUPS}
    intervals = ", ".join(f"{group} {100 * m.low:.1f}-{100 * m.high:.1f}" for group, m in means.items())
    ranked = published.group_of_task()
    trials = sorted({one.rate.trials for one in policy.conditions[UNPERTURBED] if one.task in ranked})
    said = [
        "Evaluated in robocasa_lerobot's kitchens, which are made in code in MuJoCo: other scenes, objects and "
        "demonstrations than RoboCasa's own, so not comparable one to one.",
        f"{trials[0]} trials per task, seed {header.seed}, split {header.split}, horizon 1.0x each task's own, success "
        f"at any step, executed steps {header.executed_steps or 'of the policy'}, on {_computed_on(policy)}.",
        f"95 % intervals (percent): {intervals}.",
        _weights(policy),
    ]
    return " ".join([facts.notes.strip(), *said] if facts.notes.strip() else said)


def _computed_on(policy: PolicyResult) -> str:
    return policy.header.device if policy.info.remote is None else "a server's device"


def _weights(policy: PolicyResult) -> str:
    if policy.info.remote is None:
        return f"Weights {policy.info.fingerprint[:16]}."
    return f"Asked over {policy.info.remote['protocol']}, key map {policy.info.remote['keys']}; weights unknown."


def _trained_here(policy: PolicyResult) -> bool:
    """Whether this project trained it, whose batches are counted over all processes; LeRobot's are those of one."""
    return (Path(policy.info.path) / ORIGIN_FILE).is_file()


def _of_one_process(policy: PolicyResult, facts: SubmissionFacts) -> list[str]:
    """Why the batch that a checkpoint names is not taken."""
    own = _train_config(Path(policy.info.path)).get("batch_size")
    if facts.batch_size is not None or own is None or _trained_here(policy):
        return []
    return [
        f"{Path(policy.info.path) / 'train_config.json'} has a batch_size of {own}, which lerobot-train counts for "
        "each process: give --batch-size, that of all processes together"
    ]


def _train_config(checkpoint: Path) -> dict[str, Any]:
    """The settings that LeRobot saves beside a checkpoint's weights; empty where there are none."""
    path = checkpoint / "train_config.json"
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return values if isinstance(values, dict) else {}


def _place(error: Any) -> str:
    place = ".".join(str(part) for part in error.absolute_path)
    return f"{place}: " if place else ""


def _remedy(error: Any) -> str:
    path = list(error.absolute_path)
    name = str(path[-1]) if path else ""
    known = {field.name for field in fields(SubmissionFacts)}
    return f" (give --{name.replace('_', '-')})" if name in known else ""
