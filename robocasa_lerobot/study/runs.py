"""The trainings of a study: one for each experiment and seed, run by the commands that anyone would type."""

from __future__ import annotations

import dataclasses
import re
import shutil
import signal
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from robocasa_lerobot.config_files import configs_folder
from robocasa_lerobot.data.registry.registry_file import RegisteredDataset, load_registry
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.files import write_text
from robocasa_lerobot.jobs.child_process import run_command
from robocasa_lerobot.making.needs import needs_of
from robocasa_lerobot.settings import load_yaml
from robocasa_lerobot.study.settings import EXPERIMENTS, PartConfig, StudyConfig
from robocasa_lerobot.training.config.experiment import ExperimentConfig, PhaseConfig, load_experiment

CPU, CUDA = "cpu", "cuda"
DEVICES = (CPU, CUDA)
_GPU_PIXELS = 2  # times as many each way in the pictures of a GPU
# Twice the samples: 512 at a time are three times as many a second as 64 (docs/scaling.md).
_GPU_BATCH, _GPU_STEPS = 8, 4  # times as large, and a part as many
_GPU_POLICIES = {"flow_vla_demo.yaml": "flow_vla_compact.yaml"}  # in the place of those that experiments name
_POLICY, _GPU_POLICY = "study_policy.yaml", "study_gpu.yaml"  # in configs/experiments/parts

_CRASHES = (signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL)


class StoppedError(UserError):
    """A command of a run ended before its end; the same study goes on there."""


@dataclass(frozen=True)
class Run:
    """An experiment with a seed.

    Attributes:
        experiment: file in `configs/experiments/study/`, without its ending.
        seed: of the training and of its trials; demonstrations are the same for all.
        root: folder of all trainings.
        configs: folder with `experiments/`.
        scale: to try it; see `train --scale`.
        episodes: demonstrations by kind, `KIND=N,...`, instead of the registry's; see `data --episodes`.
    """

    experiment: str
    seed: int
    root: Path
    configs: Path
    scale: str | None = None
    episodes: str | None = None

    @property
    def name(self) -> str:
        """Unlike that of any other run."""
        return f"{self.experiment}/seed_{self.seed}"

    @property
    def folder(self) -> Path:
        """Of its phases, with their checkpoints and evaluations."""
        return self.root / self.experiment / f"seed_{self.seed}"

    @property
    def file(self) -> Path:
        """Its experiment file, which `train` and `data` take."""
        return self.root / "experiments" / f"{self.experiment}-seed_{self.seed}.yaml"

    @property
    def base(self) -> Path:
        """The experiment's file, of which its own adds the seed."""
        return self.configs / "experiments" / EXPERIMENTS / f"{self.experiment}.yaml"

    @cached_property
    def config(self) -> ExperimentConfig:
        """The experiment, without its seed and folder."""
        if not self.base.is_file():
            known = [file.stem for file in self.base.parent.glob("*.yaml")]
            raise UnknownNameError("experiment", self.experiment, known, f"(of the study; there is no {self.base})")
        return load_experiment(self.base, scale=self.scale)

    @property
    def device(self) -> str:
        """The kind of device that it trains on: the experiment's, or the best one that this machine has."""
        if self.config.device is not None:
            return self.config.device
        from robocasa_lerobot.training.setup.builders import best_device  # with torch, which `--help` needs not

        return best_device(None)

    def write_file(self) -> Path:
        """Write that file and return its path."""
        self.file.parent.mkdir(parents=True, exist_ok=True)
        write_text(self.file, self._content())
        return self.file

    def loaded(self, overrides: Sequence[str] = ()) -> ExperimentConfig:
        """What that file says, which need not be there: a plan leaves nothing beside trainings that run."""
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / self.file.name
            write_text(file, self._content())
            return load_experiment(file, overrides, self.scale)

    def _content(self) -> str:
        # Other trials with each seed: three trainings tried in the same kitchens would say less.
        phases = [
            {"name": phase.name, "evaluations": [f"{text} --seed={self.seed}" for text in phase.evaluations]}
            for phase in self.config.phases
        ]
        content = {
            "base": str(self.base.absolute()),
            "seed": self.seed,
            "output_dir": str(self.folder),
            "phases": phases,
        }
        return yaml.safe_dump(content, sort_keys=False)

    def corrected_for(self, phase: PhaseConfig) -> set[str]:
        """Names of the phases whose policies are corrected for the data of this one."""
        needs, _ = needs_of(self.config, phase=phase.name)
        return {need.policy.name for need in needs if need.policy is not None}

    def commands(self, workers: int | None, left: Mapping[str, bool] | None = None) -> list[list[str]]:
        """Arguments of `robocasa-lerobot` that make its data, and then train each phase and try what it has learnt.

        Data come first, but for those that correct an earlier phase's policy, which come before the phase that asks.

        Args:
            workers: processes that make data; None is one for each core.
            left: the phases that are still to be run, and whether they are to be tried; None is all.
        """
        scale = [] if self.scale is None else [f"--scale={self.scale}"]
        made = [] if workers is None else [f"--workers={workers}"]
        made += [] if self.episodes is None else [f"--episodes={self.episodes}"]
        # What a trial with fewer demonstrations has left does not stand for them.
        data = ["data", str(self.file), "--make", "--replace", *made, *scale]
        found = [data]
        for phase in self.config.phases:
            if left is not None and phase.name not in left:
                continue
            if self.corrected_for(phase):
                found.append(data)  # again: what corrects an earlier phase's policy can be made now
            tried = ["--evaluate"] * (left is None or left[phase.name])
            found.append(["train", f"--config_path={self.file}", f"--phase={phase.name}", *tried, *scale])
        return found

    def carry_out(
        self,
        workers: int | None,
        threads: int | None = None,
        data_alone: Callable[[], AbstractContextManager[None]] = nullcontext,
        left: Mapping[str, bool] | None = None,
    ) -> Iterator[None]:
        """Make its data, then train and try phase by phase; what is finished takes seconds.

        Comes back after each phase that is tried.

        Args:
            workers: processes that make data; None is one for each core.
            threads: of a training; None leaves it to torch.
            data_alone: entered while data are made, which other runs may need as well.
            left: the phases that are still to be run, and whether they are to be tried; None is all.

        Raises:
            StoppedError: one did not end well; its own message stands above.
        """
        self.write_file()
        for command in self.commands(workers, left):
            making = command[0] == "data"
            with data_alone() if making else nullcontext():
                self._run(command, threads_variable(None if making else threads))
            if "--evaluate" in command:
                yield

    def _run(self, command: Sequence[str], environment: dict[str, str]) -> None:
        status = run_command(command, environment)
        if -status in _CRASHES:  # in a driver or library; what there is of the rest of a day should not wait for that
            print(f"ended by {signal.Signals(-status).name}, tried once more: {' '.join(command)}", flush=True)
            status = run_command(command, environment)
        if status:
            raise StoppedError(
                f"{self.name}: `robocasa-lerobot {' '.join(command)}` ended with status {status}; "
                "the same study goes on there."
            )


def threads_variable(threads: int | None) -> dict[str, str]:
    """The environment of a process in which torch has so many threads; None leaves it as it is."""
    return {} if threads is None else {"OMP_NUM_THREADS": str(threads)}


def runs_of(
    parts: Sequence[PartConfig],
    root: Path,
    configs: Path,
    scale: str | None = None,
    episodes: str | None = None,
) -> list[Run]:
    """The runs of parts, each once, part by part; all seeds of an experiment after each other."""
    found: dict[tuple[str, int], Run] = {}
    for part in parts:
        for experiment in part.experiments:
            for seed in range(part.seeds_of(experiment)):
                found.setdefault((experiment, seed), Run(experiment, seed, root, configs, scale, episodes))
    return list(found.values())


def root_for(study: StudyConfig, device: str, scale: str | None, episodes: str | None = None) -> Path:
    """The folder of the trainings: another one for each device, scale and `KIND=N,...`, which are other trainings."""
    others = [
        None if device == CPU else device,
        Path(scale).stem if scale else None,
        re.sub(r"[^\w.]+", "-", episodes) if episodes else None,
    ]
    return Path("_".join([study.root, *filter(None, others)]))


def configs_for(device: str, study: StudyConfig, root: Path) -> Path:
    """The folder of configuration files for a device: the package's own, or for a GPU a copy in `root`.

    In the copy the larger policy stands in the place of the small one, and recorded pictures have twice as many pixels
    each way, in a dataset folder of their own; so have those of experiments that name a size, and experiments that name
    a policy's file have the larger one's. Batches are eight times as large, and steps a quarter as many.

    Raises:
        UserError: the study's registry is not among the files that are copied, or has a mistake.
    """
    configs = configs_folder()
    if device == CPU:
        return configs
    if not (configs / study.registry).resolve().is_relative_to(configs.resolve()):  # it would be written to itself
        raise UserError(
            f"the study's `registry` is {study.registry}, outside of {configs}. With --device {device} a changed copy "
            "of that folder is used: put the registry file there, and name it from there."
        )
    root.mkdir(parents=True, exist_ok=True)
    copy = root / "configs"
    with tempfile.TemporaryDirectory(prefix=".configs_", dir=root) as folder:
        aside = Path(folder)
        shutil.copytree(configs, aside, dirs_exist_ok=True)
        _change_for_a_gpu(aside, study)
        for file in sorted(path for path in aside.rglob("*") if path.is_file()):
            there = copy / file.relative_to(aside)
            if not there.is_file() or there.read_bytes() != file.read_bytes():  # others may be reading it
                there.parent.mkdir(parents=True, exist_ok=True)
                file.replace(there)
    return copy


def _change_for_a_gpu(copy: Path, study: StudyConfig) -> None:
    parts = copy / "experiments" / "parts"
    shutil.copyfile(parts / _GPU_POLICY, parts / _POLICY)
    _enlarge_pictures(copy / study.registry)
    for file in sorted((copy / "experiments" / EXPERIMENTS).glob("*.yaml")):
        experiment: dict[str, Any] = load_yaml(file)
        policy = experiment.get("policy")
        if isinstance(policy, str) and Path(policy).name in _GPU_POLICIES:
            experiment["policy"] = str(Path(policy).with_name(_GPU_POLICIES[Path(policy).name]))
        elif isinstance(policy, dict) and "image_size" in policy:
            policy["image_size"] = [pixels * _GPU_PIXELS for pixels in policy["image_size"]]
        for settings in (experiment.get("defaults") or {}, *(experiment.get("phases") or [])):
            if "steps" in settings:
                settings["steps"] //= _GPU_STEPS
            if "batch_size" in settings:
                settings["batch_size"] *= _GPU_BATCH
        write_text(file, yaml.safe_dump(experiment, sort_keys=False))


def _enlarge_pictures(file: Path) -> None:
    """Let a registry file record larger pictures, in folders of their own; what is not recorded stays where it is."""
    registry = load_registry(file)  # as it is with those that it is laid over
    recorded = registry.scheme is None and all(dataset.make is not None for dataset in registry.datasets)
    own_root = recorded and Path(registry.root).name != ""
    folder = "" if own_root else f"{CUDA}/"

    def enlarged(dataset: RegisteredDataset) -> RegisteredDataset:
        if dataset.make is None:
            return dataset
        redraw = None if dataset.make.redraw is None else f"{folder}{dataset.make.redraw}"
        make = dataclasses.replace(dataset.make, image_size=dataset.make.image_size * _GPU_PIXELS, redraw=redraw)
        return dataclasses.replace(dataset, path=f"{folder}{dataset.path}", make=make)

    changed = dataclasses.replace(
        registry,
        root=f"{registry.root}_{CUDA}" if own_root else registry.root,
        datasets=[enlarged(dataset) for dataset in registry.datasets],
    )
    write_text(file, yaml.safe_dump(dataclasses.asdict(changed), sort_keys=False))
