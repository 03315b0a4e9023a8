"""Settings of an evaluation: `python eval.py --policy.path=DIR --env.tasks=OpenDrawer --trials 10`."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.evaluation.records.results import file_name
from robocasa_lerobot.evaluation.remote.address import is_address
from robocasa_lerobot.jobs.workers import cores_here

KITCHEN_ENV_FACTORY = "robocasa_lerobot.envs.kitchen_env:KitchenEnv"
SPLITS = ("target", "pretrain", "pretrain_train", "pretrain_val")
RENDER_PRESETS = ("fast", "quality")
DEVICES = ("auto", "cpu", "cuda", "mps")
RUNTIMES = ("onnx", "torch")
PLACEMENTS = ("auto", "workers", "servers")
SUCCESS_RULES = ("any_step", "hold", "at_end")
PERTURBATIONS = ("none", "language", "camera", "joint", "base")
_LONGEST_NAME = 200  # bytes: file systems take 255


@dataclass
class PolicySettings:
    """Which policies are evaluated, and how they compute. `--policy=X` alone is short for `--policy.path=X`.

    path: `pretrained_model` folders, or reference policies: `demonstrator`, `random`, `zero`, or `replay:FILE` with an
        HDF5 file of demonstrations or a LeRobotDataset; or a server that is asked over a socket: openpi://HOST:PORT,
        gr00t://HOST:PORT, vla_eval://HOST:PORT. Several give one report.
    keys: for each policy behind a socket (or one for all), the key map: a preset such as robocasa365_pi0, `auto`, or a
        YAML file; default: what the protocol or the server itself says.
    label: their names in results and report; default: `experiment/phase-step` of the checkpoint's training.
    device: auto, cpu, cuda or mps.
    devices: devices with a policy process each, such as cuda:0,cuda:1; default: all GPUs.
    placement: workers (a replica in each worker), servers (a process for each device, which batches the observations
        that wait), or auto (servers on a GPU). Outcomes do not depend on it.
    batch_width: observations that are computed at once; fewer are filled up, so that an outcome does not depend on
        who shares a batch. 0: 8 on a GPU for policies that draw the noise of each observation by itself, else 1.
    threads: CPU threads of each policy. Fixed, not derived from the number of workers, because sums of floats depend
        on it, and a trial's outcome must not depend on how trials are spread over processes.
    runtime: onnx (ONNX Runtime computes this project's own policies where they are on a CPU: twice as fast, with other
        last bits than PyTorch) or torch.
    lifelong_phase: for each policy, the phase (from 1) that it was trained up to, 0 for the untrained one; a label, and
        what `lifelong` reads.
    demo_fraction: for each policy, the share of the target demonstrations that it was trained on; a label.
    training_data: for each policy, what it was trained on, such as "target only"; a label.
    """

    path: list[str] = field(default_factory=list)
    keys: list[str] = field(default_factory=list)
    label: list[str] = field(default_factory=list)
    device: str = "auto"
    devices: list[str] = field(default_factory=list)
    placement: str = "auto"
    batch_width: int = 0
    threads: int = 1
    runtime: str = "onnx"
    lifelong_phase: list[int] = field(default_factory=list)
    demo_fraction: list[float] = field(default_factory=list)
    training_data: list[str] = field(default_factory=list)


@dataclass
class RemoteSettings:
    """Patience with policies behind a socket; outcomes do not depend on it.

    connect_seconds: for which it is tried again while nobody listens, so that a server may start late or again.
    answer_seconds: until an answer.
    first_answer_seconds: until the first answer over a connection: servers compile on their first request.
    """

    connect_seconds: float = 60.0
    answer_seconds: float = 120.0
    first_answer_seconds: float = 900.0


@dataclass
class EnvSettings:
    """In which kitchens, on which tasks, and for how long.

    tasks: task names; they take the place of task_sets, whose other tasks are then noted as missing.
    task_sets: sets of the benchmark, such as atomic_seen, composite_seen, composite_unseen, lifelong_phase1, or of
        the registry.
    registry: YAML file of datasets whose `task_sets` are meant too; its own win. Default: the benchmark's alone.
    tasks_per_set: so many tasks of each set, the first that this version has; default: all.
    allow_missing_tasks: tasks that this version does not have are left out, and the results are marked as partial;
        false refuses to run without them.
    split: target or pretrain scenes; or of the latter pretrain_val, fifty kitchens, or pretrain_train, all others.
    render_preset: fast or quality.
    image_size: pixels, height and width; default: what the checkpoint was trained at, else 256.
    horizon: control steps at 20 Hz for all tasks; default: each task's own.
    horizon_multiplier: factor on each task's own horizon.
    factory: `module:callable` that makes the env, called with task, split, render_preset, image_size and horizon; with
        `python`, `module:callable` or `FILE.py:callable` of that interpreter (docs/simulators.md). Success rules that
        look at more than the first success add `terminate_on_success=False`.
    python: interpreter in which another simulator's envs run; default: this one.
    type: `lerobot:NAME`, an env that LeRobot knows, such as lerobot:pusht, in `python` or here, in place of a factory.
    options: arguments of another simulator's factory, as `--env.options.NAME=VALUE`.
    render_devices: EGL devices that the workers are dealt out to (`robocasa-lerobot doctor` lists them; the numbers
        are not CUDA's); default: EGL's choice, its first one for all.
    """

    tasks: list[str] = field(default_factory=list)
    task_sets: list[str] = field(default_factory=list)
    registry: str | None = None
    tasks_per_set: int | None = None
    allow_missing_tasks: bool = True
    split: str = "target"
    render_preset: str = "fast"
    image_size: int | None = None
    horizon: int | None = None
    horizon_multiplier: float = 1.0
    factory: str = KITCHEN_ENV_FACTORY
    python: str | None = None
    type: str | None = None
    options: dict[str, Any] = field(default_factory=dict)
    render_devices: list[int] = field(default_factory=list)

    @property
    def is_kitchen(self) -> bool:
        """Whether the env is this package's own."""
        return self.factory == KITCHEN_ENV_FACTORY and not self.is_foreign

    @property
    def is_foreign(self) -> bool:
        """Whether the env is another simulator's, in a process of its own."""
        return self.python is not None or self.type is not None


@dataclass
class SuccessSettings:
    """When a trial counts as solved.

    rule: any_step (the goal held after any step, and the trial ends there), hold (it held for hold_steps in a row),
        or at_end (it holds after the last step of the horizon).
    hold_steps: control steps at 20 Hz.
    """

    rule: str = "any_step"
    hold_steps: int = 1


@dataclass
class PerturbationSettings:
    """Differences from the plain env. Standard deviations are of Gaussian noise, drawn anew for each trial.

    names: none, language (a wording that no demonstration has), camera, joint, base; trials run under each of them.
    camera_position_m: of both agentview cameras, metres per axis.
    camera_angle_deg: of both agentview cameras, degrees about each axis.
    wrist_position_m: of the wrist camera, metres per axis.
    wrist_angle_deg: of the wrist camera, degrees about each axis.
    joint_rad: of the arm's joints at the start, radians; the plain env has 0.02.
    base_position_m: of the base at the start, metres per axis.
    base_yaw_deg: of the base's heading at the start, degrees.
    """

    names: list[str] = field(default_factory=lambda: ["none"])
    camera_position_m: float = 0.10
    camera_angle_deg: float = 6.0
    wrist_position_m: float = 0.00625
    wrist_angle_deg: float = 0.75
    joint_rad: float = 0.10
    base_position_m: float = 0.10
    base_yaw_deg: float = 10.0


@dataclass
class EvaluationConfig:
    """All settings of an evaluation.

    protocol: name of the protocol that the settings follow, for the results; configs/evaluations/ has them.
    trials: trials of each policy on each task.
    seed: fixes scenes, starts and the policy's sampling noise of all trials.
    executed_steps: executed steps of each predicted action chunk; default: the policy's own.
    lifelong: each policy runs the first policy.lifelong_phase of the task sets only.
    workers: parallel processes; 0: one for each CPU core that it may use, on Slurm and Ray for each core of a shard.
        Outcomes do not depend on it.
    shard: I/N: only the I-th of N parts of the plan, in shards/I-of-N of the output folder; `merge` joins them.
    videos: how many trials of each policy on each task are filmed: the first ones, and where these show no success or
        no failure, the first such trial is run once more for its film. 0: no films.
    out: folder of trials.jsonl, videos and report; default: outputs/evaluations/<labels>.
    retry_errors: run trials again that are recorded with an error.
    stall_seconds: a worker that reports no progress for so long is ended, and its trial tried once more.
    report: write the report at the end: report.html, .md, .tex and two .csv.
    scale: name of the scale at which this is a trial of a larger experiment, for the results (training sets it).
    """

    policy: PolicySettings = field(default_factory=PolicySettings)
    remote: RemoteSettings = field(default_factory=RemoteSettings)
    env: EnvSettings = field(default_factory=EnvSettings)
    success: SuccessSettings = field(default_factory=SuccessSettings)
    perturbation: PerturbationSettings = field(default_factory=PerturbationSettings)
    protocol: str = "custom"
    trials: int = 10
    seed: int = 0
    executed_steps: int | None = None
    lifelong: bool = False
    workers: int = 0
    shard: str | None = None
    videos: int = 2
    out: str | None = None
    retry_errors: bool = False
    stall_seconds: float = 300.0
    report: bool = True
    scale: str | None = None

    def __post_init__(self) -> None:
        """Check what can be checked without opening anything.

        Raises:
            UserError: a setting out of its range.
        """
        policy, env = self.policy, self.env
        if not policy.path:
            raise UserError(
                "no policy: give --policy.path=CHECKPOINT/pretrained_model, openpi://HOST:PORT, random, or zero."
            )
        if not env.tasks and not env.task_sets:
            raise UserError("no task: give --env.tasks=OpenDrawer (`robocasa-lerobot tasks` lists them).")
        for name in ("label", "lifelong_phase", "demo_fraction", "training_data"):
            given = getattr(policy, name)
            if given and len(given) != len(policy.path):
                raise UserError(f"{len(given)} policy.{name} for {len(policy.path)} policy.path.")
        remote = sum(map(is_address, policy.path))
        if policy.keys and len(policy.keys) not in (1, remote):
            raise UserError(f"{len(policy.keys)} policy.keys for {remote} policies behind a socket.")
        if policy.keys and not remote:
            raise UserError("policy.keys is for policies behind a socket, such as openpi://HOST:PORT; there is none.")
        if self.lifelong and not (policy.lifelong_phase and env.task_sets):
            raise UserError("lifelong needs env.task_sets in the order of the phases and --policy.lifelong_phase=K.")
        if self.lifelong and 0 in policy.lifelong_phase:
            raise UserError(
                "policy.lifelong_phase: found 0, the untrained policy, which has no task sets of its own: give "
                "--lifelong=false, with which each policy runs all task sets."
            )
        if any(not 0 <= share <= 1 for share in policy.demo_fraction):
            raise UserError(f"policy.demo_fraction: found {policy.demo_fraction}, expected shares between 0 and 1.")
        for what, names in (
            ("policy.label", policy.label),
            ("env.tasks", env.tasks),
            ("env.task_sets", env.task_sets),
            ("perturbation.names", self.perturbation.names),
        ):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise UserError(f"{what}: {', '.join(twice)} given twice.")
        choices: list[tuple[str, str, Iterable[str]]] = [
            ("env.split", env.split, SPLITS),
            ("policy.device", policy.device, DEVICES),
            ("policy.placement", policy.placement, PLACEMENTS),
            ("policy.runtime", policy.runtime, RUNTIMES),
            ("env.render_preset", env.render_preset, RENDER_PRESETS),
            ("success.rule", self.success.rule, SUCCESS_RULES),
            *(("perturbation", name, PERTURBATIONS) for name in self.perturbation.names),
        ]
        for name, value, known in choices:
            if value not in known:
                raise UnknownNameError(name, value, known)
        self._check_numbers()

    @property
    def first_sets(self) -> int | None:
        """How many of the task sets any policy runs; None is all."""
        return max(self.policy.lifelong_phase) if self.lifelong else None

    def _check_numbers(self) -> None:
        env, policy = self.env, self.policy
        at_least = {
            "trials": (self.trials, 1),
            "workers": (self.workers, 0),
            "videos": (self.videos, 0),
            "seed": (self.seed, 0),
            "policy.threads": (policy.threads, 1),
            "policy.batch_width": (policy.batch_width, 0),
            "executed_steps": (self.executed_steps, 1),
            "env.image_size": (env.image_size, 16),
            "env.horizon": (env.horizon, 1),
            "env.tasks_per_set": (env.tasks_per_set, 1),
            "success.hold_steps": (self.success.hold_steps, 1),
            **{f"policy.lifelong_phase[{i}]": (phase, 0) for i, phase in enumerate(policy.lifelong_phase)},
        }
        for name, (number, low) in at_least.items():
            if number is not None and number < low:
                raise UserError(f"{name}: found {number}, expected at least {low}.")
        for option in fields(self.perturbation):
            value = getattr(self.perturbation, option.name)
            if option.name != "names" and not (math.isfinite(value) and value >= 0):
                raise UserError(f"perturbation.{option.name}: found {value}, expected a number of at least 0.")
        for option in fields(self.remote):
            if not getattr(self.remote, option.name) > 0:
                raise UserError(f"remote.{option.name}: found {getattr(self.remote, option.name)}, expected above 0.")
        if not (math.isfinite(env.horizon_multiplier) and env.horizon_multiplier > 0):
            raise UserError(f"env.horizon_multiplier: found {env.horizon_multiplier}, expected a number above 0.")
        if not self.stall_seconds > 0:
            raise UserError(f"stall_seconds: found {self.stall_seconds}, expected a number above 0.")
        if env.horizon is not None and env.horizon_multiplier != 1.0:
            raise UserError("env.horizon and env.horizon_multiplier exclude each other: give one of them.")
        if self.success.hold_steps != 1 and self.success.rule != "hold":
            raise UserError(f"success.hold_steps has no effect with success.rule={self.success.rule}: give hold.")
        if env.horizon is not None and self.success.hold_steps > env.horizon:
            raise UserError(
                f"success.hold_steps: found {self.success.hold_steps}, but a trial lasts {env.horizon} steps "
                "(env.horizon): none could be solved."
            )

    def worker_count(self, trials: int) -> int:
        """Processes to start for `trials` trials."""
        return max(1, min(self.workers or cores_here(), trials))


def check_factory(factory: str) -> None:
    """The factory must be written `module:callable`."""
    module, colon, name = factory.partition(":")
    if not (module and colon and name):
        raise UserError(f"env.factory: found {factory!r}, expected module:callable, e.g. {KITCHEN_ENV_FACTORY}.")


def output_folder(config: EvaluationConfig, labels: list[str]) -> Path:
    """Where results go: `out`, or a folder named after the policies."""
    if config.out:
        return Path(config.out)
    name = "-".join(map(file_name, labels))
    if len(name.encode()) > _LONGEST_NAME:
        name = f"{len(labels)}-policies-{hashlib.sha256(name.encode()).hexdigest()[:12]}"
    return Path("outputs/evaluations") / name
