"""What processes that convert import before their work, by name: the process that workers are forked from does it."""

LEAN_LEROBOT = "robocasa_lerobot.convert.lean_lerobot"
SHARD_IMPORTS = (LEAN_LEROBOT, "robocasa_lerobot.convert.shard")
V2_SHARD_IMPORTS = (LEAN_LEROBOT, "robocasa_lerobot.convert.lerobot_v2.shard")
RENDER_IMPORTS = (LEAN_LEROBOT, "robocasa_lerobot.convert.rerender.work")
