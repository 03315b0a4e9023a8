"""What an operator may say in which phase, and what it does to the session."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.teleop.driving import assist
from robocasa_lerobot.teleop.keeping.store import REDO
from robocasa_lerobot.teleop.messages import Message
from robocasa_lerobot.teleop.session import (
    DONE,
    LOADING,
    PAUSED,
    READY,
    REVIEW,
    REWINDING,
    RUNNING,
    SAVING,
    Session,
)
from robocasa_lerobot.teleop.views import FREE, SEEN

Order = Callable[[Session, Message, float], None]

_ALWAYS = {LOADING, READY, RUNNING, PAUSED, REWINDING, REVIEW, SAVING, DONE}
_OPEN = {READY, RUNNING, PAUSED, REWINDING, REVIEW}
_DRIVEN = {READY, RUNNING, PAUSED}
_REWIND_SPEED = 2.0


def carry_out(session: Session, message: Message, now: float) -> None:
    """Carry out what the operator says, or answer that it is not possible now."""
    phases, order = _ORDERS[message.type]
    if session.phase in phases:
        order(session, message, now)
    else:
        what = message.type.replace("_", " ")
        session.note("warning", f"{what} is not possible while {session.phase}", message.type)


def _input(session: Session, message: Message, now: float) -> None:
    if session.phase not in _DRIVEN:  # what is still held from before
        return
    if session.phase == PAUSED and not session.resumes:  # nothing but "resume" goes on, and nothing is to take over
        return
    camera = message.get("motion_camera", "")
    if camera and not _known(session, message, [camera], but=FREE):
        return
    asks = session.driver.hold(message, now)
    if asks and (session.phase == READY or session.resumes):
        session.run(now)


def _action(session: Session, message: Message, now: float) -> None:
    if not session.driver.queue(message):
        session.note("warning", "too many actions wait: this one is left out", "action")
    elif session.phase == READY or session.resumes:
        session.run(now)


def _clock(session: Session, message: Message, now: float) -> None:
    session.driver.by_steps = message["clock"] == "steps"


def _set(session: Session, message: Message, now: float) -> None:
    steering = session.driver.steering
    camera = message.get("motion_camera", "")
    if (camera and not _known(session, message, [camera], but=FREE)) or not _known(
        session, message, message.get("cameras", ())
    ):
        return
    steering.mode = message.get("mode", steering.mode)
    steering.speed = message.get("speed", steering.speed)
    steering.frame = message.get("motion_frame", steering.frame)
    steering.camera = camera or steering.camera
    session.cameras = tuple(dict.fromkeys(message.get("cameras", session.cameras)))


def _view(session: Session, message: Message, now: float) -> None:
    session.free.set(message, session.env.data)


def _pause(session: Session, message: Message, now: float) -> None:
    session.hold_still("asked")


def _resume(session: Session, message: Message, now: float) -> None:
    session.run(now)


def _focus(session: Session, message: Message, now: float) -> None:
    if not message["on"]:
        session.hold_still("focus")


def _rewind(session: Session, message: Message, now: float) -> None:
    steps = message.get("steps")
    if steps is not None:
        session.go_back(max(session.shown - steps, 0))
    elif message.get("on", True):
        session.rewind(now, message.get("speed", _REWIND_SPEED))
    elif session.phase == REWINDING:
        session.end_rewinding()


def _mark(session: Session, message: Message, now: float) -> None:
    session.driven.mark()


def _back_to_mark(session: Session, message: Message, now: float) -> None:
    session.go_back(session.driven.last_mark())


def _drive_to(session: Session, message: Message, now: float) -> None:
    closed = session.driver.steering.closed
    goal = message["x"], message["y"], message.get("yaw")
    _assist(session, message, assist.drive(session.env, *goal, closed=closed), now)


def _reach(session: Session, message: Message, now: float) -> None:
    name = message["camera"]
    if not _known(session, message, [name]):
        return
    data, free = session.pictures.shown(message.get("frame", 0), session.env, session.free)
    camera = free.camera(data) if name == FREE else name
    try:
        what, point = assist.point_under(session.env, data, camera, message["u"], message["v"])
    except SkillError as error:
        session.note("warning", str(error), "reach")
        return
    session.note("info", f"reaching above {what}", "reach")
    _assist(session, message, assist.reach_above(session.env, point, closed=session.driver.steering.closed), now)


def _assist(session: Session, message: Message, actions: Iterator[Array], now: float) -> None:
    session.driver.assist(message.type, actions)
    session.run(now)


def _stop(session: Session, message: Message, now: float) -> None:
    session.driver.assistance = None


def _start(session: Session, message: Message, now: float) -> None:
    if session.pilot is not None:  # it may be a person's turn still, from before everything was undone
        session.driver.release()
        session.pilot.give_back()
    session.run(now)


def _take_over(session: Session, message: Message, now: float) -> None:
    if _has_policy(session, message) and session.pilot is not None:
        session.driver.release()
        session.pilot.take_over()


def _give_back(session: Session, message: Message, now: float) -> None:
    if _has_policy(session, message) and session.pilot is not None:
        session.driver.release()
        session.pilot.give_back()
        session.run(now)


def _end(session: Session, message: Message, now: float) -> None:
    session.review()


def _review(session: Session, message: Message, now: float) -> None:
    session.playback.set(message.get("play"), message.get("speed"), message.get("seek"))
    session.driven.show(session.playback.step)


def _continue(session: Session, message: Message, now: float) -> None:
    if session.driven.successful:
        session.note("warning", "it has ended by success: save it, or rewind to change it", "continue")
    else:
        session.drive_on()


def _save(session: Session, message: Message, now: float) -> None:
    if session.driven.successful:
        session.save(trim=message.get("trim", False))
    else:
        held = session.driven.held
        why = f"it has held for {held} steps only" if held else "it does not hold at the end"
        session.note("warning", f"an episode is kept where its goal is reached: {why}", "save")


def _redo(session: Session, message: Message, now: float) -> None:
    session.discard(REDO, now)


def _discard(session: Session, message: Message, now: float) -> None:
    reason = message["reason"].strip()
    if reason in ("", REDO):
        session.note("warning", "a reason is needed", "discard")
    else:
        session.discard(reason, now)


def _finish(session: Session, message: Message, now: float) -> None:
    session.finish()


def _has_policy(session: Session, message: Message) -> bool:
    if session.pilot is None:
        session.note("warning", "no policy drives here: start with --policy", message.type)
    return session.pilot is not None


def _known(session: Session, message: Message, cameras: list[str] | tuple[str, ...], but: str = "") -> bool:
    """Whether these are cameras that are shown; else a note says so."""
    unknown = [camera for camera in cameras if camera not in SEEN or camera == but]
    if unknown:
        session.note("warning", f"no camera {unknown[0]!r}; there are {', '.join(SEEN)}", message.type)
    return not unknown


_ORDERS: dict[str, tuple[set[str], Order]] = {
    "input": (_ALWAYS, _input),
    "action": (_DRIVEN, _action),
    "clock": (_ALWAYS, _clock),
    "set": (_ALWAYS, _set),
    "view": (_OPEN, _view),
    "pause": ({RUNNING}, _pause),
    "resume": ({PAUSED}, _resume),
    "focus": (_ALWAYS, _focus),
    "rewind": ({RUNNING, PAUSED, REWINDING, REVIEW}, _rewind),
    "mark": ({RUNNING, PAUSED}, _mark),
    "back_to_mark": ({RUNNING, PAUSED}, _back_to_mark),
    "drive_to": (_DRIVEN, _drive_to),
    "reach": (_DRIVEN, _reach),
    "stop": (_ALWAYS, _stop),
    "start": ({READY}, _start),
    "take_over": (_DRIVEN, _take_over),
    "give_back": (_DRIVEN, _give_back),
    "end": ({RUNNING, PAUSED}, _end),
    "review": ({REVIEW}, _review),
    "continue": ({REVIEW}, _continue),
    "save": ({REVIEW}, _save),
    "redo": (_OPEN, _redo),
    "discard": (_OPEN, _discard),
    "finish": (_ALWAYS - {LOADING, SAVING}, _finish),
}
