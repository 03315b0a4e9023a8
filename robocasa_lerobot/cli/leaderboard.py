"""`robocasa-lerobot leaderboard`: the submission file of a run, or the reasons why it is none."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from robocasa_lerobot.errors import UnknownNameError, UserError

EXAMPLE = "robocasa-lerobot leaderboard outputs/evaluations/mine -o submission.json --model-name Mine --batch-size 128"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("results", nargs="?", type=Path, metavar="RUN", help="folder with a trials.jsonl")
    parser.add_argument(
        "--out",
        "-o",
        type=Path,
        default=Path("submission.json"),
        metavar="FILE",
        help="JSON to write (default: %(default)s)",
    )
    parser.add_argument("--policy", default=None, metavar="LABEL", help="which policy, where the run has several")
    parser.add_argument("--check", type=Path, default=None, metavar="FILE", help="only check an existing submission")
    facts = parser.add_argument_group("facts that no results file knows")
    facts.add_argument("--model-name", help="how the model is called")
    facts.add_argument("--policy-family", help="e.g. VLA or Diffusion Policy; default: the policy's type")
    facts.add_argument("--date", metavar="YYYY-MM-DD", help="default: today")
    facts.add_argument(
        "--submission-source",
        choices=("external", "internal"),
        default="external",
        help="internal: of RoboCasa's own team (default: %(default)s)",
    )
    facts.add_argument(
        "--open-source", choices=("yes", "no"), default="yes", help="whether the code is public (default: %(default)s)"
    )
    facts.add_argument("--code-url", default="N/A", metavar="URL", help="of the code (default: %(default)s)")
    facts.add_argument("--checkpoint-url", default="N/A", metavar="URL", help="of the weights (default: %(default)s)")
    facts.add_argument("--paper-link", default="N/A", metavar="URL", help="of a paper (default: %(default)s)")
    facts.add_argument("--commit-hash", help="default: the commit that the run was made with")
    facts.add_argument("--wandb", metavar="URL", help="of the training's curves (default: none)")
    facts.add_argument("--batch-size", type=int, help="global batch; default: from a checkpoint that was trained here")
    facts.add_argument("--num-training-steps", type=int, help="default: from the checkpoint")
    facts.add_argument("--notes", default="", help="added to the notes on simulator, trials and intervals")


def run(args: argparse.Namespace) -> int:
    """Write the submission and print the leaderboard's own average."""
    import json

    from robocasa_lerobot.evaluation.leaderboard.submission import SubmissionFacts, make_submission, overall, problems
    from robocasa_lerobot.evaluation.report.gather import gather
    from robocasa_lerobot.files import write_text

    if (args.results is None) == (args.check is None):
        raise UserError("give the folder of a run, or --check with a submission file.")
    if args.check is not None:
        try:
            values = json.loads(args.check.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise UserError(f"{args.check}: not a JSON file that can be read ({error}).") from error
        found = problems(values)
        if found:
            raise UserError(f"{args.check} is no submission:\n" + "\n".join(f"- {problem}" for problem in found))
        print(f"{args.check}: a valid submission, overall {overall(values)} %")
        return 0
    policies = {policy.label: policy for policy in gather([args.results]).single}
    if args.policy is None and len(policies) > 1:
        raise UserError(
            f"{args.results} has {len(policies)} policies: choose one with --policy ({', '.join(policies)})."
        )
    label = args.policy or next(iter(policies))
    if label not in policies:
        raise UnknownNameError("policy", label, policies)
    facts = SubmissionFacts(**{field.name: getattr(args, field.name) for field in dataclasses.fields(SubmissionFacts)})
    values = make_submission(policies[label], facts)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    write_text(args.out, json.dumps(values, indent=2, ensure_ascii=False) + "\n")
    print(f"{args.out}: {label}, overall {overall(values)} % as the leaderboard computes it")
    return 0
