"""What clients are told of a session beside its pictures."""

from __future__ import annotations

import statistics
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import base_pose, grip_position
from robocasa_lerobot.demos.recorder import SUCCESS_HOLD_STEPS
from robocasa_lerobot.teleop.messages import MODES, MOTION_FRAMES, PROTOCOL
from robocasa_lerobot.teleop.session import PAUSED, REVIEW, RUNNING, Session
from robocasa_lerobot.teleop.settings import EXPIRES_S, STALE_S, TeleopSettings
from robocasa_lerobot.teleop.views import SEEN

SPEEDS = (0.25, 0.5, 1.0)
DISCARD_REASONS = ("task failed", "object dropped", "wrong object", "bad quality", "kitchen unsuitable", "other")
_LEAST_PACE_S = 0.25


def hello(settings: TeleopSettings, role: str) -> dict[str, Any]:
    """The first message to a client."""
    return {
        "type": "hello",
        "protocol": PROTOCOL,
        "role": role,
        "task": settings.task,
        "split": settings.split,
        "wanted": settings.episodes,
        "control_hz": contract.CONTROL_HZ,
        "cameras": list(SEEN),
        "modes": list(MODES),
        "motion_frames": list(MOTION_FRAMES),
        "speeds": list(SPEEDS),
        "policy": settings.policy or None,
        "hide_goal": settings.hide_goal,
        "input_expires_ms": round(1000 * EXPIRES_S),
        "stale_ms": round(1000 * STALE_S),
        "discard_reasons": list(DISCARD_REASONS),
        "free_view": settings.free_view or None,
    }


def header(session: Session, number: int, now: float) -> dict[str, Any]:
    """What a picture comes with; who watches is added by the server."""
    steering, driver = session.driver.steering, session.driver
    running = session.phase == RUNNING
    told: dict[str, Any] = {
        "type": "frame",
        "id": number,
        "phase": session.phase,
        "step": 0,
        "horizon": session.env.horizon,
        "time": 0.0,
        "terms": {},
        "success": None,
        "held": 0,
        "hold": SUCCESS_HOLD_STEPS,
        "mode": steering.mode,
        "gripper": "closed" if steering.closed else "open",
        "speed": steering.speed,
        "motion_frame": steering.frame,
        "motion_camera": steering.camera,
        "robot": None,
        "real_time": real_time(session) if running else None,
        "step_ms": round(1000 * statistics.median(session.seconds), 1) if session.seconds else None,
        "age_ms": round(1000 * session.ages[-1], 1) if session.ages else None,
        "input": driver.device,
        "saved": len(session.store.saved),
        "wanted": session.settings.episodes,
        "discarded": session.store.discarded,
        "undos": 0,
        "marks": [],
        "assisted": None,
        "pause": session.pause if session.phase == PAUSED else None,
        "policy": session.pilot.describe(driving=running) if session.pilot else None,
        "review": None,
    }
    if driver.assistance is not None:
        steps = {"steps": driver.assistance.steps} if driver.assistance.steps else {"planning": True}
        told["assisted"] = {"kind": driver.assistance.kind, **steps}
    if session.episode is not None:
        told |= _of_episode(session)
    return told


def _of_episode(session: Session) -> dict[str, Any]:
    episode = session.driven
    step = session.shown
    position, heading = base_pose(session.env.data)
    told: dict[str, Any] = {
        "step": step,
        "time": round(step / contract.CONTROL_HZ, 3),
        "held": 0 if session.settings.hide_goal else episode.held_at(step),
        "undos": episode.undos,
        "marks": episode.marks,
        "robot": {
            "x": round(float(position[0]), 4),
            "y": round(float(position[1]), 4),
            "yaw": round(heading, 4),
            "hand": [round(float(value), 4) for value in grip_position(session.env.data)],
        },
    }
    if not session.settings.hide_goal:
        terms = {name: bool(held) for name, held in episode.info["success_terms"].items()}
        told |= {"terms": terms, "success": bool(episode.info["success"])}
    if session.phase == REVIEW:
        told["review"] = {
            "steps": len(episode),
            "playing": session.playback.playing,
            "speed": session.playback.speed,
            "success": episode.successful,
            "idle_head": episode.idle_head(),
        }
    return told


def real_time(session: Session) -> float | None:
    """Simulated seconds per second over the last two; None where too little is known."""
    if len(session.paces) < 2:
        return None
    (began, first), (ended, last) = session.paces[0], session.paces[-1]
    if ended - began < _LEAST_PACE_S:
        return None
    return round((last - first) / contract.CONTROL_HZ / (ended - began), 3)
