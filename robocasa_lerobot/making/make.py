"""Recording and converting what an experiment lacks, by the recipes of its registries."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from robocasa_lerobot.corrections.disturbances import with_disturbances
from robocasa_lerobot.data.registry.published import dataset_version
from robocasa_lerobot.data.registry.recipes import REPLAY, RecipeConfig
from robocasa_lerobot.demos.attempts import Parts, RecordingSettings
from robocasa_lerobot.demos.hdf5 import read_summary
from robocasa_lerobot.files import write_text, written_aside
from robocasa_lerobot.jobs.executors import Execution
from robocasa_lerobot.jobs.pieces import share_done
from robocasa_lerobot.jobs.publish import held_folder, partial_folders
from robocasa_lerobot.making.needs import WORK, Need
from robocasa_lerobot.making.pieces import Outcome, run_pieces

if TYPE_CHECKING:
    from robocasa_lerobot.corrections.settings import CorrectionSettings
    from robocasa_lerobot.demos.generate.settings import GenerationSettings

_PRELOAD = ("robocasa_lerobot.envs.kitchen_env", "robocasa_lerobot.convert.shard")
SOURCES, SOURCE_SEEDS = "sources", 50_000_000  # folder of those that are multiplied, and how far off their seeds are
_REASON = "reason.txt"
_HALF = 0.5  # of the work on a dataset is recording, half drawing and encoding
_DRAWN = 0.99  # of the latter comes before the pieces are joined


@dataclass(frozen=True)
class MadeDataset:
    """A piece: a dataset that is recorded and converted, and those that are drawn again from it.

    Attributes:
        need: the dataset.
        drawn: the others.
        replace: make those anew that have fewer demonstrations than asked for.
        keep: leave the HDF5 file that was recorded.
    """

    need: Need
    drawn: tuple[Need, ...] = ()
    replace: bool = False
    keep: bool = False

    @property
    def name(self) -> str:
        """Its folder."""
        return str(self.need.root)

    @property
    def work(self) -> Path:
        """Recordings and the log."""
        return self.need.work.absolute()

    @property
    def size(self) -> int:
        """Demonstrations, those that are drawn again counted again."""
        return sum(need.demonstrations or 0 for need in (self.need, *self.drawn))

    def done(self) -> float:
        """Demonstrations that are recorded count half, and more as their pictures are drawn."""
        lacking = [need for need in (self.need, *self.drawn) if self._lacks(need)]
        count = float(self.size - sum(need.demonstrations or 0 for need in lacking))
        if self.need not in lacking:
            return count + sum((need.demonstrations or 0) * _share_drawn(need) for need in lacking)
        settings = recording_settings(self.need)
        folder = self._instead if self._instead.exists() else self.work
        if (folder / f"{settings.task}.hdf5").exists():
            return _HALF * settings.episodes * (1.0 + _share_drawn(self.need))
        try:
            names = os.listdir(Parts(folder, settings).folder)  # noqa: PTH208 names will do, and there may be thousands
        except FileNotFoundError:
            return 0.0
        recorded = sum(name.endswith(".hdf5") for name in names)
        return _HALF * min(recorded, settings.episodes)

    def make(self, workers: int) -> str:
        """Record, convert, and draw again; files that are there are left alone. Returns what people should be told.

        Raises:
            UserError: too many attempts failed, a dataset of other making is already there, or it is being made.
        """
        with held_folder(self.work):
            if self._lacks(self.need):
                self._drop_other_numbers()
                self._record_and_convert(workers)
            for need in self.drawn:
                if self._lacks(need):
                    self._draw_again(need, workers)
            note = self._instead / _REASON
            return note.read_text(encoding="utf-8") if note.is_file() else ""

    @property
    def _instead(self) -> Path:
        """Folder of what is recorded because nothing could be generated, with the reason."""
        return self.work / "recorded"

    def _lacks(self, need: Need) -> bool:
        if dataset_version(need.root) != "v3.0":
            return True
        if not self.replace:
            return False
        info = json.loads((need.root / "meta/info.json").read_text(encoding="utf-8"))
        return int(info["total_episodes"]) < (need.demonstrations or 0)

    def _drop_other_numbers(self) -> None:
        """Remove finished files of other numbers of demonstrations, which a kill before their conversion has left.

        What is not a file yet goes on: attempts are the same for any number.
        """
        settings = recording_settings(self.need)
        name = f"{settings.task}.hdf5"
        if _other_number(self.work / SOURCES / name, _recipe(self.need).sources_for(settings.episodes)):
            shutil.rmtree(self.work / SOURCES)  # and what was generated from these
            shutil.rmtree(Parts(self.work, settings).folder, ignore_errors=True)
            (self.work / name).unlink(missing_ok=True)
        for folder in (self.work, self._instead):
            if _other_number(folder / name, settings.episodes):
                (folder / name).unlink()

    def _record_and_convert(self, workers: int) -> None:
        from robocasa_lerobot.convert.pipeline import convert
        from robocasa_lerobot.convert.settings import ConversionSettings

        made = self._record(workers)
        self.need.root.parent.mkdir(parents=True, exist_ok=True)
        if self.keep:  # before the dataset is there: after that nothing of it would be made again
            made = _kept(made, self.need.root.with_name(f"{self.need.root.name}.hdf5"))
        conversion = ConversionSettings(image_size=_recipe(self.need).image_size)
        convert([made], self.need.root, conversion, workers, overwrite=self.replace)

    def _record(self, workers: int) -> Path:
        """The file of demonstrations: generated where the recipe has sources and it can be done, else recorded."""
        from robocasa_lerobot.demos.generate.sources.source import UnfitSourcesError
        from robocasa_lerobot.demos.generate.stage import can_generate
        from robocasa_lerobot.demos.recording import record_task, record_tasks
        from robocasa_lerobot.envs.tasks.registry import get_task

        settings, recipe = recording_settings(self.need), _recipe(self.need)
        if self.need.policy is not None:
            corrections = _corrections(self.need.policy, settings, recipe)
            return record_task(corrections, self.work, workers=workers, show_progress=False).path
        if self._instead.exists():  # of a run before
            return record_task(settings, self._instead, workers=workers, show_progress=False).path
        number = recipe.sources_for(settings.episodes)
        if not number or not (recipe.method == REPLAY or can_generate(get_task(settings.task))):
            return record_task(settings, self.work, workers=workers, show_progress=False).path
        # In kitchens of the same kind; of other seeds, since nothing but replays is made in a source's own scene.
        own = replace(settings, episodes=number, seed=settings.seed + SOURCE_SEEDS, action_noise=0.0)
        sources = record_task(own, self.work / SOURCES, workers=workers, show_progress=False).path
        try:
            generation = self._generation(sources, workers)
        except UnfitSourcesError as error:  # what passes, as sources that are being prepared, does not decide
            reason = str(error)
        else:
            made = record_tasks([generation], self.work, workers=workers, show_progress=False)[0]
            if not made.gave_up:
                return made.path
            reason = made.gave_up
        self._instead.mkdir(parents=True)
        write_text(self._instead / _REASON, f"recorded, since generating it came to nothing: {reason}")
        return record_task(settings, self._instead, workers=workers, show_progress=False).path

    def _generation(self, sources: Path, workers: int) -> GenerationSettings:
        """What is generated from recorded sources, which are prepared unless they are only repeated."""
        from robocasa_lerobot.demos.generate.settings import GenerationSettings
        from robocasa_lerobot.demos.generate.sources.prepare import prepare_files

        recipe = _recipe(self.need)
        if recipe.method != REPLAY:
            deque(prepare_files([sources], workers=workers), maxlen=0)
        settings = replace(recording_settings(self.need), varied=False)
        return GenerationSettings.of(sources.parent, method=recipe.method, **vars(settings))

    def _draw_again(self, need: Need, workers: int) -> None:
        from robocasa_lerobot.convert.rerender.camera_configs import camera_set
        from robocasa_lerobot.convert.rerender.plan import RenderSettings
        from robocasa_lerobot.convert.rerender.work import render_dataset

        need.root.parent.mkdir(parents=True, exist_ok=True)
        configs = camera_set(str(_recipe(need).camera_set))
        settings = RenderSettings(cam_configs=json.dumps(configs, sort_keys=True))
        render_dataset(self.need.root, need.root, settings, workers, overwrite=self.replace)


def recording_settings(need: Need) -> RecordingSettings:
    """What `demos` records for a dataset."""
    recipe = _recipe(need)
    settings = RecordingSettings(
        need.task,
        need.demonstrations or 1,
        split=need.split,
        seed=recipe.seed,
        action_noise=recipe.action_noise,
        layouts=tuple(recipe.layouts) if recipe.layouts is not None else None,
        styles=tuple(recipe.styles) if recipe.styles is not None else None,
        varied=recipe.varied,
    )
    return with_disturbances(settings, recipe.disturbances)


def _corrections(policy: Path, settings: RecordingSettings, recipe: RecipeConfig) -> CorrectionSettings:
    """What `correct` records for a dataset.

    Raises:
        CheckpointError: the policy is not there.
    """
    from robocasa_lerobot.corrections.settings import CorrectionSettings

    after = {} if recipe.after is None else {"after_steps": tuple(recipe.after)}
    return CorrectionSettings.of(str(policy), **vars(settings), **after)


def pieces_of(needs: Sequence[Need], replace: bool = False, keep: bool = False) -> list[MadeDataset]:
    """The pieces for datasets that are missing, or have too few demonstrations, as far as recipes can make them."""
    made = [need for need in needs if need.made is not None]
    pieces = [
        MadeDataset(need, tuple(other for other in made if other.redrawn == need.root), replace, keep)
        for need in made
        if need.redrawn is None
    ]
    return [piece for piece in pieces if any(piece._lacks(need) for need in (piece.need, *piece.drawn))]


def make_datasets(pieces: Sequence[MadeDataset], execution: Execution, cores: int) -> Outcome:
    """Make them; see `run_pieces`."""
    from robocasa_lerobot.gl import ensure_drawing

    if execution.kind == "local":
        ensure_drawing()
    root = pieces[0].need.registry_root
    outcome = run_pieces(pieces, root / WORK, execution, cores, "making", "demo", _PRELOAD)
    if not outcome.submitted:
        _clear_empty(root / WORK)
    return outcome


def _share_drawn(need: Need) -> float:
    """How much of a dataset that is being converted or drawn has been, never all: it is not there yet."""
    return _DRAWN * max(map(share_done, partial_folders(need.root)), default=0.0)


def _kept(made: Path, kept: Path) -> Path:
    """The same recording at the place where it stays; one of before is replaced."""
    with written_aside(kept) as aside:
        aside.unlink(missing_ok=True)  # of a run that was killed
        try:
            aside.hardlink_to(made)
        except OSError:  # not all file systems have links
            shutil.copyfile(made, aside)
    return kept


def _other_number(file: Path, episodes: int) -> bool:
    """Whether a file was recorded to have another number of demonstrations."""
    return file.exists() and (read_summary(file).settings or {}).get("episodes") != episodes


def _clear_empty(folder: Path) -> None:
    """Remove folders in which nothing is left."""
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir():
            with contextlib.suppress(OSError):
                path.rmdir()
    with contextlib.suppress(OSError):
        folder.rmdir()


def _recipe(need: Need) -> RecipeConfig:
    assert need.made is not None
    assert need.made.make is not None
    return need.made.make
