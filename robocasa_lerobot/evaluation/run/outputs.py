"""What a complete evaluation leaves beside its trials: rates on the terminal, `eval_info.json`, the report."""

from __future__ import annotations

from robocasa_lerobot.evaluation.records.eval_info import write_eval_info
from robocasa_lerobot.evaluation.records.results import read_results
from robocasa_lerobot.evaluation.run.engine import Evaluation


def write_outputs(evaluation: Evaluation) -> None:
    """Print the success rates, write LeRobot's `eval_info.json` and, if the settings want it, the report."""
    from robocasa_lerobot.evaluation.report.output import print_rates, write_report

    write_eval_info(read_results(evaluation.out), evaluation.out)
    print_rates([evaluation.out])
    if evaluation.config.report:
        write_report([evaluation.out], out=evaluation.out / "report.html")
