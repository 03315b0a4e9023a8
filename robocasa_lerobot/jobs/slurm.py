"""Jobs of a Slurm cluster: an array of pieces by datatrove, and the one that comes after them.

`python -m robocasa_lerobot.jobs.slurm FILE` is that last job: it calls the function pickled in the file.
"""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from datatrove.executor.base import DistributedEnvVars
from datatrove.executor.slurm import SlurmPipelineExecutor, default_job_id_retriever, launch_slurm_job
from datatrove.utils.logging import logger as datatrove_logger

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import write_text


class NotedError(Exception):
    """A job that Slurm has taken could not be noted."""


def read_record(file: Path) -> list[str]:
    """The jobs that were noted.

    Raises:
        UserError: the file cannot be read as such.
    """
    try:
        jobs = json.loads(file.read_text(encoding="utf-8"))
        if isinstance(jobs, list):
            return [str(job) for job in jobs]
    except ValueError:
        pass
    raise UserError(
        f"{file}: found no list of jobs. See with squeue whether jobs of an earlier call still run; remove the file "
        "when none does."
    )


@dataclass
class JobRecord:
    """Finds a job's number in what sbatch said, and notes it in a file at once: what comes after may fail.

    Attributes:
        file: JSON list of the jobs of one submission; one of an earlier submission is replaced.
        jobs: their numbers so far.
    """

    file: Path
    jobs: list[str] = field(default_factory=list)

    def __call__(self, said: str) -> str:
        """The job's number."""
        number = str(default_job_id_retriever(said, -1))
        self.jobs.append(number)
        try:
            write_text(self.file, json.dumps(self.jobs))
        except OSError as error:
            raise NotedError(str(error)) from error
        return number


class ArrayExecutor(SlurmPipelineExecutor):
    """datatrove's Slurm executor for pieces that need nothing of each other."""

    def run(self) -> None:
        """Submit the array or, inside one of its jobs, run the piece; exceptions are not logged but raised."""
        datatrove_logger.disable("datatrove")
        super().run()

    def launch_merge_stats(self) -> None:
        """Nothing: datatrove counts documents here, of which there are none."""

    def get_distributed_env(self, node_rank: int = -1) -> DistributedEnvVars:
        """Nothing of it is used, and asking Slurm for the names of nodes can fail."""
        return DistributedEnvVars(
            datatrove_node_ips="",
            datatrove_cpus_per_task=str(self.cpus_per_task),
            datatrove_mem_per_cpu=str(self.mem_per_cpu_gb),
            datatrove_gpus_on_node=str(self.gpus_per_task),
            datatrove_executor="SLURM",
        )

    def submit_after(self, arrays: Sequence[str], command: str) -> str:
        """Submit one job that runs a command once every job of the arrays has succeeded; gives its number."""
        arguments: dict[str, Any] = {k: v for k, v in self.get_sbatch_args().items() if k not in ("array", "gpus")}
        arguments["job-name"] = f"{self.job_name}-join"
        if arrays:
            arguments["dependency"] = f"afterok:{':'.join(arrays)}"
            arguments["kill-on-invalid-dep"] = "yes"
        for key in ("output", "error"):
            arguments[key] = str(Path(self.slurm_logs_folder) / "join-%j.out")
        return str(launch_slurm_job(self.get_launch_file_contents(arguments, command), self.job_id_retriever))


def main() -> None:
    """Call the pickled function; a whole number that it returns is the job's exit status."""
    result = pickle.loads(Path(sys.argv[1]).read_bytes())()
    sys.exit(result if isinstance(result, int) else 0)


if __name__ == "__main__":
    main()
