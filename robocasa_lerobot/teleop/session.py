"""A session of driving by hand, without clock, thread or socket: what its phases are and what each does in a tick.

`orders.py` has what an operator may say in which of them, `telling.py` what clients are told.
"""

from __future__ import annotations

import collections
import statistics
from collections import Counter
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.control_step import DivergedError
from robocasa_lerobot.errors import OF_THE_MACHINE, UserError
from robocasa_lerobot.provenance import git_commit
from robocasa_lerobot.teleop.driving.driver import Driver
from robocasa_lerobot.teleop.driving.pilot import AUTONOMOUS, Pilot, PolicyFailedError
from robocasa_lerobot.teleop.keeping.episode import Episode
from robocasa_lerobot.teleop.keeping.pictures import LastPictures
from robocasa_lerobot.teleop.keeping.playback import Playback, Rewinding
from robocasa_lerobot.teleop.keeping.store import Store
from robocasa_lerobot.teleop.settings import LONGEST_STEPS, TeleopSettings
from robocasa_lerobot.teleop.views import SEEN, FreeCamera, KitchenMap, Views, kitchen_map

# Phases: see `protocol.md`.
LOADING, READY, RUNNING, PAUSED = "loading", "ready", "running", "paused"
REWINDING, REVIEW, SAVING, DONE = "rewinding", "review", "saving", "done"
_AGES, _STEP_TIMES = 2000, 20  # of what is remembered
_PACE_STEPS = 41  # over which simulated seconds per second are counted
_BACK_ON_DIVERGENCE = 20  # steps
_MOST_UNMADE = 5  # kitchens, one after the other, that cannot be made


class Session:
    """One operator's kitchens, one after the other, until enough episodes are saved.

    Args:
        settings: what was asked for.
        store: where saved episodes go.
        env: made with `terminate_on_success=False`; without cameras, unless for the pilot.
        pilot: policy that drives where nobody intervenes.

    Attributes:
        phase: see `protocol.md`.
        pause: why time stands in `paused`.
        outgoing: messages for all clients, until somebody takes them.
        episode: what is driven now; None while a kitchen is made.
        scenes: kitchens shown so far; map: of the present one.
        driver, free, cameras: who drives, the free camera, which pictures are sent.
        pictures: that were drawn last.
        playback, rewinding: in `review` and `rewinding`.
        resumes: whether the next input ends a pause by itself.
        ages, paces, seconds: of commands' pictures, steps and their times, lately.
        failure: why the session is done before its time, or without its file.
    """

    def __init__(self, settings: TeleopSettings, store: Store, env: KitchenEnv, pilot: Pilot | None = None) -> None:
        self.settings, self.store, self.env, self.pilot = settings, store, env, pilot
        self.phase, self.pause = LOADING, ""
        self.outgoing: list[dict[str, Any]] = []
        self.episode: Episode | None = None
        self.scenes, self.map = 0, KitchenMap(b"", 0, 0, 0.0, 0.0, 1.0)
        self.driver, self.free, self.cameras = Driver(pilot=pilot), FreeCamera(), SEEN
        self.playback, self.rewinding = Playback(0), Rewinding(0.0, 1.0, 0.0)
        self.resumes = False
        self.ages: collections.deque[float] = collections.deque(maxlen=_AGES)
        self.paces: collections.deque[tuple[float, int]] = collections.deque(maxlen=_PACE_STEPS)
        self.seconds: collections.deque[float] = collections.deque(maxlen=_STEP_TIMES)
        self._views = Views(settings.image_size, settings.render_preset)
        self._number, self._began = store.next_number(), 0.0
        self._announced = self._trim = False
        self._unmade = 0
        self.pictures = LastPictures()
        self.failure: UserError | None = None
        if len(store.saved) >= settings.episodes:
            self.finish()

    @property
    def driven(self) -> Episode:
        """The episode, where there is one."""
        assert self.episode is not None, "a kitchen is being made"
        return self.episode

    @property
    def shown(self) -> int:
        """The step of the episode whose state is shown; after the last one, how many there are."""
        if self.phase == REVIEW:
            return self.playback.step
        return self.rewinding.step if self.phase == REWINDING else len(self.driven)

    @property
    def hurries(self) -> bool:
        """Whether the next tick need not wait for its time: a script's actions are there, or work without pictures."""
        return (self.phase == RUNNING and self.driver.by_steps and self.driver.waiting > 0) or self.phase in (
            LOADING,
            SAVING,
        )

    @property
    def clocked(self) -> bool:
        """Whether time goes on by itself, so that an operator who sees nothing is in danger."""
        return self.phase == RUNNING and not self.driver.by_steps

    def tick(self, now: float) -> bool:
        """Go on by a step of 50 ms; whether there is something new to see."""
        if self.phase in (LOADING, SAVING):
            if not self._announced:  # a picture of this phase goes out first
                self._announced = True
            elif self.phase == LOADING:
                self._load()
            else:
                self._save(now)
            return True
        if self.phase == RUNNING:
            return self._drive(now)
        self.paces.clear()
        if self.phase == REWINDING:
            shown = self.rewinding.next(now)
            if shown is None:
                self.end_rewinding()
            else:
                self.driven.show(shown)
            return True
        if self.phase == REVIEW:
            shown = self.playback.next()
            if shown is not None:
                self.driven.show(shown)
            return shown is not None
        return False

    def draw(self, now: float) -> tuple[int, list[tuple[dict[str, Any], bytes]]]:
        """A number for the picture of the present state, counting up, and its parts: what each is, and the JPEG."""
        if self.episode is None or self.phase in (LOADING, SAVING, DONE):
            return self.pictures.add(now, None, self.free), []
        number = self.pictures.add(now, self.episode.states[self.shown], self.free)
        seen = self.episode.observation.get("pixels", {}) if self.env.render_observations else {}
        return number, self._views.take(self.env, seen, self.cameras, self.free)

    def run(self, now: float) -> None:
        """Let time run; with the first input the episode begins."""
        self._began = self._began or now
        self.phase, self.pause, self.resumes = RUNNING, "", False

    def hold_still(self, why: str) -> None:
        """Let go of everything, and pause if time runs: `asked`, `focus`, `stale` or `disconnected`."""
        self.driver.release()
        if self.phase == REWINDING:
            self.end_rewinding()
        elif self.phase == RUNNING:
            self.phase, self.pause, self.resumes = PAUSED, why, False

    def rewind(self, now: float, speed: float) -> None:
        """Go backwards from what is shown, for as long as this is repeated."""
        if self.phase != REWINDING:
            self.rewinding = Rewinding(float(self.shown), speed, now)
            self.driver.release()
            self.phase, self.pause = REWINDING, ""
        self.rewinding.hold(speed, now)

    def end_rewinding(self) -> None:
        """Go on from what is shown."""
        self.go_back(self.rewinding.step)

    def go_back(self, step: int) -> None:
        """Drop a step and all after it; the next input goes on."""
        self.driven.rewind_to(step)
        self.driver.begin(closed=self.driven.gripper_closed)
        self.phase, self.pause = (PAUSED, "asked") if step else (READY, "")
        self.resumes = True

    def review(self) -> None:
        """Look at the episode as it is."""
        self.driver.release()
        self.playback = Playback(len(self.driven))
        self.phase, self.pause = REVIEW, ""

    def drive_on(self) -> None:
        """From the review back to the end of the episode; the next input goes on."""
        self.driven.show(len(self.driven))
        self.driver.begin(closed=self.driven.gripper_closed)
        self.phase, self.pause, self.resumes = PAUSED, "asked", True

    def save(self, *, trim: bool) -> None:
        """Have the episode confirmed and kept at the next ticks."""
        self.phase, self._trim, self._announced = SAVING, trim, False

    def discard(self, reason: str, now: float) -> None:
        """Note that this attempt came to nothing; the next kitchen, or with `REDO` the same again."""
        episode = self.driven
        steps, wall = len(episode), self._wall(now)
        try:
            self.store.discard(self._number, reason, steps=steps, undos=episode.undos, wall_seconds=wall)
        except OSError as error:
            self.note("error", f"it could not be noted ({error}): free disk space and try it again", "discard")
            if self.phase == SAVING:
                self.review()
            return
        told = {"seed": episode.seed, "steps": steps, "reason": reason, "discarded": self.store.discarded}
        self.outgoing.append({"type": "discarded", **told})
        self._next()

    def finish(self) -> None:
        """End the session: what is saved becomes one file. `failure` says why not, where the disk is full."""
        if self.phase == DONE:
            return
        self.driver.release()
        self.phase, self.pause = DONE, ""
        path = None
        try:
            path = self.store.merge()
        except OSError as error:
            self._fail(f"{self.store.path.name} could not be written ({error})")
        self.outgoing.append({"type": "done", "path": path.name if path else None, "saved": len(self.store.saved)})

    def close(self) -> None:
        """Free what draws."""
        self._views.close()
        self.env.close()

    def note(self, level: str, text: str, about: str) -> None:
        """Tell people something."""
        self.outgoing.append({"type": "note", "level": level, "text": text, "about": about})

    def _load(self) -> None:
        again = self.episode is not None and self.episode.seed == self.settings.seed + self._number
        self.env.render_observations, self.episode = False, None
        try:
            self.episode = Episode(self.env, self.settings.seed + self._number)
            if not again:
                self._views.open(self.env)
                self.map = kitchen_map(self.env)
            self._unmade = 0
        except OF_THE_MACHINE:
            raise
        except Exception as error:  # as for demonstrators: one kitchen that cannot be made ends no session
            self.episode, self._unmade = None, self._unmade + 1
            if self._unmade >= _MOST_UNMADE:
                raise
            self.note("error", f"kitchen {self.settings.seed + self._number} cannot be made ({error})", "scene")
            why = f"{type(error).__name__}: {error}"
            try:
                self.store.discard(self._number, why, steps=0, undos=0, wall_seconds=0.0)
            except OSError as lacking:  # without the note the same kitchen would come again
                self._fail(f"nothing can be noted in {self.store.folder} ({lacking})")
                self.finish()
            else:
                self._next()
            return
        self.scenes += 1
        self.free.anchor = None
        self.driver.begin()
        if self.pilot is not None:
            self.pilot.begin()
        self.ages.clear()
        self.phase, self.pause, self._began = READY, "", 0.0
        info = self.episode.info
        terms = [] if self.settings.hide_goal else list(info["success_terms"])
        told = {"instruction": info["instruction"], "horizon": self.env.horizon, "terms": terms, **info["scene"]}
        told["map"] = self.map.describe()
        self.outgoing.append({"type": "scene", "seed": self.episode.seed, "episode": self.scenes, **told})

    def _drive(self, now: float) -> bool:
        episode, driver, env = self.driven, self.driver, self.env
        if driver.assistance is not None and not driver.assistance.told:
            driver.assistance.told = True  # a picture goes out first: planning may take seconds
            return True
        if self._policy_looks() and not env.render_observations and not driver.by_steps:
            env.render_observations = True
            episode.show(len(episode))
        try:
            planned = driver.next(env, episode.observation, now, lambda level, text: self.note(level, text, "assist"))
        except PolicyFailedError as error:
            assert self.pilot is not None
            self.note("error", f"the policy failed ({error}): you drive; give back to try it again", "policy")
            self.pilot.lost()
            self.hold_still("asked")
            return True
        if planned is None:
            return False
        age = self.pictures.age(driver.answered, now)
        if age is not None:
            self.ages.append(age)
        driver.answered = None
        env.render_observations = self._policy_looks()
        try:
            episode.step(*planned)
        except DivergedError as error:
            self.note("error", f"{error} The last second was undone instead.", "input")
            self.go_back(max(len(episode) - _BACK_ON_DIVERGENCE, 0))
            return True
        self.paces.append((now, len(episode)))
        if episode.successful:
            self.review()
        elif len(episode) >= LONGEST_STEPS:
            self.note("warning", "the episode has become too long to go on", "input")
            self.review()
        return True

    def _policy_looks(self) -> bool:
        return self.pilot is not None and self.pilot.state == AUTONOMOUS

    def _save(self, now: float) -> None:
        episode = self.driven
        self.env.render_observations = False
        trimmed = episode.idle_head() if self._trim else 0
        if trimmed:
            shorter = self._without_head(episode, trimmed)
            if shorter is None:
                episode.show(len(episode))
                self.note("warning", f"without its first {trimmed} steps it does not succeed: save it whole", "save")
                self.review()
                return
            episode = shorter  # the whole one stays, in case this one cannot be written
        if not episode.confirmed():
            self.note("error", "its actions do not lead through its states again: it is not kept", "save")
            self.discard("not reproducible", now)
            return
        wall = self._wall(now)
        meta = {"teleop": self._meta(episode, trimmed, wall)}
        recording = episode.recording(meta, with_policy=self.pilot is not None)
        try:
            self.store.save(self._number, recording, undos=episode.undos, wall_seconds=wall)
        except OSError as error:
            self.note("error", f"it could not be written ({error}): free disk space and save it again", "save")
            self.driven.show(len(self.driven))
            self.review()
            return
        self.episode = episode
        saved, wanted = len(self.store.saved), self.settings.episodes
        told = {"seed": episode.seed, "steps": len(episode), "saved": saved, "wanted": wanted}
        self.outgoing.append({"type": "saved", **told})
        self.note("info", f"saved as episode {saved} of {wanted}", "save")
        self._next()

    @staticmethod
    def _without_head(episode: Episode, steps: int) -> Episode | None:
        """The episode without its first steps, where it succeeds without."""
        try:
            shorter = episode.without_head(steps)
        except DivergedError:
            return None
        return shorter if shorter.successful else None

    def _fail(self, why: str) -> None:
        """Tell the page, and the command at its end; the first reason counts."""
        remedy = f"What is saved is whole in {self.store.folder}: free disk space and give the same command again."
        self.failure = self.failure or UserError(f"{why}. {remedy}")
        self.note("error", f"{why}. {remedy}", "finish")

    def _meta(self, episode: Episode, trimmed: int, wall: float) -> dict[str, Any]:
        """How an episode was driven, for its `ep_meta`."""
        devices = Counter(origin.device or "nothing" for origin in episode.origins)
        driven = (len(episode) + episode.undone_steps) / contract.CONTROL_HZ
        return {
            "device": devices.most_common(1)[0][0],
            "devices": dict(devices),
            "modes": dict(Counter(origin.mode for origin in episode.origins if origin.mode)),
            "operator": self.settings.operator,
            "undos": episode.undos,
            "undone_steps": episode.undone_steps,
            "trimmed_steps": trimmed,
            "assisted_steps": sum(origin.assisted for origin in episode.origins),
            "intervention_steps": sum(origin.intervention for origin in episode.origins),
            "interventions": self.pilot.interventions if self.pilot else 0,
            "policy": self.pilot.name if self.pilot else "",
            "wall_seconds": round(wall, 2),
            # All that was driven, undone steps too, per second from the first input to the end, pauses included.
            "speed": round(driven / wall, 3) if wall else None,
            "picture_age_ms": round(1000 * statistics.median(self.ages), 1) if self.ages else None,
            "git_commit": git_commit(),
        }

    def _wall(self, now: float) -> float:
        return now - self._began if self._began else 0.0

    def _next(self) -> None:
        """The next kitchen, or the end."""
        self._number, self._announced = self.store.next_number(), False
        if len(self.store.saved) >= self.settings.episodes:
            self.finish()
        else:
            self.phase = LOADING
