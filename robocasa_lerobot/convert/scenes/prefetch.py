"""The next scene compiled in a process of its own, while the present one is drawn.

MuJoCo's bindings keep Python's lock while they compile and draw, so threads would take turns. One scene at most is
ahead. It is handed over through files without names, which are gone when both processes are. Nothing depends on the
other process: what fails there, or dies there, is not handed over, and whoever needs that scene makes it himself, with
the errors that this gives.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import select
import signal
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from robocasa_lerobot.convert.anonymous_file import anonymous_file
from robocasa_lerobot.jobs.child_process import start_serving

if TYPE_CHECKING:
    from robocasa_lerobot.convert.scenes.compiled import CompiledScene

# Where a scene comes from: gives the loadable MJCF and its files. It can be pickled, and compared by value.
SceneSource = Callable[[], tuple[str, dict[str, bytes]]]
_STARTED = "started"  # the other process's first message
# The other process draws nothing: MuJoCo need not load a driver.
_WITHOUT_OPENGL = {"MUJOCO_GL": "disabled"}


class ScenesAhead:
    """Has scenes compiled that will be needed; the process is started when it is first wanted."""

    def __init__(self) -> None:
        self._compiler: _Compiler | None = None
        self._wanted: SceneSource | None = None  # has been asked for and not been taken
        self._given_up = False
        self._owner = os.getpid()

    def request(self, source: SceneSource, preset: str, *, pictures: bool) -> None:
        """Have a scene compiled, in place of an earlier one that nobody took; with its look-alike for `pictures`.

        Nothing is asked for while the process is still starting with an earlier request.
        """
        self._check_owner()
        if self._given_up:
            return
        try:
            if self._compiler is None:
                self._compiler = _Compiler()
            if self._wanted is not None:
                if not self._compiler.has_started():
                    return
                self._compiler.answer()
            self._wanted = source
            self._compiler.ask((source, preset, pictures))
        except (OSError, EOFError, pickle.UnpicklingError):
            self._give_up()

    def take(self, source: SceneSource) -> CompiledScene | None:
        """The scene that was requested last; None if it is another one, or could not be made.

        Waits for it, but not for the process to start: that takes longer than to make the scene.
        """
        self._check_owner()
        if self._wanted is None or self._wanted != source:
            return None
        from robocasa_lerobot.convert.scenes.compiled import kept

        assert self._compiler is not None
        try:
            if not self._compiler.has_started():
                return None
            self._wanted = None
            answer = self._compiler.answer()
            return None if answer is None else kept(answer, self._compiler.files)
        except (OSError, EOFError, ValueError, pickle.UnpicklingError):
            self._give_up()
            return None

    def close(self) -> None:
        """End the process, if it runs."""
        self._check_owner()
        if self._compiler is not None:
            self._compiler.close()
        self._compiler = self._wanted = None
        self._given_up = False

    def _give_up(self) -> None:
        """Do without until `close`: a process that has died would die again."""
        self.close()
        self._given_up = True

    def _check_owner(self) -> None:
        if self._owner != os.getpid():  # a fork must not write into its parent's pipe
            self._compiler = self._wanted = None
            self._given_up, self._owner = False, os.getpid()


scenes_ahead = ScenesAhead()


class _Compiler:
    """The other process, seen from this one."""

    def __init__(self) -> None:
        self.files = anonymous_file("model"), anonymous_file("merged_model")
        down_read, down_write = os.pipe()
        up_read, up_write = os.pipe()
        self._process = start_serving(__name__, (down_read, up_write, *self.files), **_WITHOUT_OPENGL)
        os.close(down_read)
        os.close(up_write)
        self._pipe = os.fdopen(down_write, "wb")
        self._answers = os.fdopen(up_read, "rb")
        self._started = False

    def has_started(self) -> bool:
        if not self._started and select.select([self._answers], [], [], 0)[0]:
            self._started = pickle.load(self._answers) == _STARTED
        return self._started

    def ask(self, message: Any) -> None:
        pickle.dump(message, self._pipe)
        self._pipe.flush()

    def answer(self) -> Any:
        return pickle.load(self._answers)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        with contextlib.suppress(OSError):  # what was not sent cannot be sent any more
            self._pipe.close()
        self._answers.close()
        for file in self.files:
            os.close(file)


def serve(down: int, up: int, *files: int) -> None:
    """The other process: compile the requested scenes until the pipe is closed.

    Args:
        down: file descriptor to read requests from.
        up: file descriptor to write to: first that it is ready, then for each request the record beside the files, or
            None where something failed.
        files: file descriptors into which the models are written.
    """
    from robocasa_lerobot.convert.scenes.compiled import CompiledScene, KeptScene, keep

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a user's Ctrl-C: the process that asks ends this one
    model, merged_model = files
    with os.fdopen(down, "rb") as pipe, os.fdopen(up, "wb") as answers, contextlib.suppress(BrokenPipeError, EOFError):
        pickle.dump(_STARTED, answers)
        answers.flush()
        while True:
            source, preset, pictures = pickle.load(pipe)
            answer: KeptScene | None = None
            with contextlib.suppress(Exception):  # whatever it is, the process that asks will see it for itself
                xml, assets = source()
                scene = CompiledScene.of(xml, assets, preset)
                answer = keep(scene.with_merged_model() if pictures else scene, (model, merged_model))
            pickle.dump(answer, answers)
            answers.flush()
