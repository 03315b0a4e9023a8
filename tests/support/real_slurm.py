"""A Slurm of one node on this machine: Debian's own daemons on loopback addresses, in a folder that goes away."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

PARTITION = "cpu"
_PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scancel", "sinfo")
_START_SECONDS = 60.0
_CONFIG = """
ClusterName=kitchens
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort={controller}
SlurmdPort={node}
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
MpiDefault=none
ReturnToService=2
SchedulerParameters=sched_interval=1,batch_sched_delay=0
NodeName=localhost NodeAddr=127.0.0.1 CPUs=2 RealMemory={memory} State=UNKNOWN
PartitionName={partition} Nodes=localhost Default=YES MaxTime=INFINITE State=UP
"""


class NoSlurmError(Exception):
    """Why Slurm cannot run here."""


@dataclass(frozen=True)
class Slurm:
    """A running one; commands find it by the variable `SLURM_CONF`."""

    folder: Path

    @property
    def environment(self) -> dict[str, str]:
        return {**os.environ, "SLURM_CONF": str(self.folder / "slurm.conf")}

    def ask(self, *command: str) -> str:
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=60, check=False)
        return done.stdout + done.stderr

    def wait(self, seconds: float) -> None:
        """Until nothing waits or runs any more."""
        deadline = time.monotonic() + seconds
        while queue := self.ask("squeue", "--noheader").strip():
            assert time.monotonic() < deadline, f"still in the queue after {seconds:g} s:\n{queue}"
            time.sleep(0.5)


@contextmanager
def running_slurm(folder: Path) -> Iterator[Slurm]:
    """The daemons, from the start to the end of the body.

    Raises:
        NoSlurmError: a program is missing, this is not root, or a daemon does not come up.
    """
    missing = [name for name in _PROGRAMS if shutil.which(name) is None]
    if missing:
        raise NoSlurmError(f"no {', '.join(missing)} (Debian: slurmd, slurmctld, slurm-client, munge)")
    if os.geteuid() != 0:
        raise NoSlurmError("the daemons run as root, and this is not")
    controller, node = _free_ports(2)
    megabytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20
    for name in ("state", "spool"):
        (folder / name).mkdir(parents=True)
    folder.chmod(0o755)
    (folder / "munge.key").write_bytes(os.urandom(1024))
    (folder / "munge.key").chmod(0o600)
    (folder / "slurm.conf").write_text(
        _CONFIG.format(
            folder=folder, controller=controller, node=node, memory=int(megabytes * 0.9), partition=PARTITION
        )
    )
    slurm = Slurm(folder)
    with ExitStack() as stack:
        files = {"key-file": "munge.key", "socket": "munge.socket", "pid-file": "munge.pid", "seed-file": "munge.seed"}
        munge = [f"--{option}={folder / name}" for option, name in files.items()]
        _start(stack, slurm, "munged", "--force", "--foreground", f"--log-file={folder / 'munged.log'}", *munge)
        _until(lambda: (folder / "munge.socket").exists(), slurm)
        _start(stack, slurm, "slurmctld", "-D")
        _start(stack, slurm, "slurmd", "-D", "-N", "localhost")
        _until(lambda: slurm.ask("sinfo", "--noheader", "--format=%t").strip() == "idle", slurm)
        stack.callback(slurm.ask, "scancel", "--full", "--partition", PARTITION)
        yield slurm


def _start(stack: ExitStack, slurm: Slurm, name: str, *arguments: str) -> None:
    out = stack.enter_context((slurm.folder / f"{name}.out").open("w"))
    command = [str(shutil.which(name)), *arguments]
    process = subprocess.Popen(command, env=slurm.environment, stdout=out, stderr=out, stdin=subprocess.DEVNULL)

    def end() -> None:
        process.terminate()
        try:
            process.wait(15)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    stack.callback(end)


def _until(ready: object, slurm: Slurm) -> None:
    assert callable(ready)
    deadline = time.monotonic() + _START_SECONDS
    while not ready():
        if time.monotonic() > deadline:
            said = [f"{file.name}: {file.read_text()[-500:]}" for file in sorted(slurm.folder.glob("*.out"))]
            raise NoSlurmError("not up after a minute; " + " ".join(said))
        time.sleep(0.2)


def _free_ports(count: int) -> list[int]:
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [int(one.getsockname()[1]) for one in sockets]
