"""The card of a checkpoint, `README.md` in its `pretrained_model` folder: what it is, its data, how to use it.

The hub shows it as the model's page: `hf upload OWNER/NAME FOLDER` publishes both.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

CARD = "README.md"
_SHOWN = 20


def write_model_card(folder: Path, kind: str, experiment: str | None, phase_dir: Path, step: int) -> None:
    """Write the card of a checkpoint of a policy of that kind."""
    file = phase_dir / "phase.json"
    about: dict[str, Any] = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    data = [str(line) for line in about.get("data", [])]
    more = [f"- and {len(data) - _SHOWN} more"] if len(data) > _SHOWN else []
    lines = [
        "---",
        "library_name: lerobot",
        "pipeline_tag: robotics",
        f"tags: [lerobot, robocasa, {kind}]",
        "---",
        f"# {experiment or 'policy'}: {phase_dir.name}, step {step:,}",
        "",
        f"A policy of the kind `{kind}` for tasks in kitchens, trained with robocasa-lerobot.",
        "",
        f"- parameters: {about.get('parameters', 'not known')}",
        f"- started from: {Path(str(about.get('init', 'not known'))).name}; statistics: {about.get('statistics')}",
        f"- versions: {', '.join(f'{k} {v}' for k, v in (about.get('versions') or {}).items())}",
        f"- commit: {about.get('git_commit')}",
        "",
        "## Data",
        *(f"- {line}" for line in data[:_SHOWN]),
        *more,
        "",
        "## Licence and attribution",
        "Weights carry the licences of their data and of the weights that they started from: name both if you publish.",
        "Tasks and protocols follow RoboCasa365 (https://robocasa.ai), which is to be cited.",
        "",
        "## Use",
        "```bash",
        "robocasa-lerobot eval --config_path configs/evaluations/quick.yaml --policy.path=FOLDER",
        "```",
        "",
    ]
    (folder / CARD).write_text("\n".join(lines), encoding="utf-8")
