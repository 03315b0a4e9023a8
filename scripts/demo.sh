#!/bin/sh
# From a kitchen to a report: demonstrations -> dataset -> two training phases -> seeded trials -> report.
# Only public commands, so each line can be typed by hand. Run through `make demo`; when it was interrupted, the
# same command goes on where it stopped. `rm -r outputs/demo` starts over. Everything is written below the working
# directory, so that `make bench-demo` can run it with several seeds beside each other.
set -eu

ROOT=$(cd "$(dirname "$0")/.." && pwd)
PYTHON=${PYTHON:-$ROOT/.venv/bin/python}
OUT=outputs/demo              # where configs/experiments/demo.yaml has its dataset and its results
DEMOS=${DEMOS:-OpenDrawer=280 CloseDrawer=80} # tasks, and how many demonstrations of each
IMAGE_SIZE=${IMAGE_SIZE:-64}  # pixels
TRIALS=${TRIALS:-8}           # trials of each policy on each task
HORIZON=${HORIZON:-250}       # control steps of a trial: much more than a demonstration takes, a third of OpenDrawer's own
EXPERIMENT=${EXPERIMENT:-$ROOT/configs/experiments/demo.yaml}
SEED=${SEED:-0}               # of demonstrations, training and trials
CORES=$("$PYTHON" -c 'import os; print(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count())')
WORKERS=${WORKERS:-$CORES}

export HF_HUB_OFFLINE=1 # nothing of the demo is downloaded
export HF_HOME="${HF_HOME:-$PWD/$OUT/cache}"
# One choice for all steps, made once: OpenGL where a GPU is behind it, else our own code, which needs none.
if [ -z "${MUJOCO_GL:-}" ]; then
    choice=$("$PYTHON" -c 'from robocasa_lerobot.gl import ensure_drawing; print(ensure_drawing() or "cpu")')
    case $choice in
        cpu) export ROBOCASA_LEROBOT_RENDERER=cpu ;;
        default) ;;
        *) export MUJOCO_GL="$choice" ;;
    esac
fi

started=$(date +%s)
step() {
    now=$(date +%s)
    printf '\n== %02d:%02d  %s\n' $(((now - started) / 60)) $(((now - started) % 60)) "$1"
}
robocasa_lerobot() { "$PYTHON" -m robocasa_lerobot.cli "$@"; }

mkdir -p "$OUT"

step "demonstrations: $DEMOS"
for demos in $DEMOS; do
    robocasa_lerobot demos --tasks "${demos%=*}" --episodes "${demos#*=}" --split target --seed $((SEED * 1000)) \
        --workers "$WORKERS" --out "$OUT/demos"
done

step "conversion to a LeRobotDataset v3.0"
[ -d "$OUT/data/meta" ] ||
    robocasa_lerobot convert "$OUT"/demos/*.hdf5 --image-size "$IMAGE_SIZE" --workers "$WORKERS" --out "$OUT/data"
robocasa_lerobot verify "$OUT/data" --pictures-per-episode 1

step "training: pretraining on all tasks, then fine-tuning on one"
"$PYTHON" "$ROOT/train.py" --config_path "$EXPERIMENT" --seed="$SEED"

step "evaluation: $TRIALS trials of the untrained, the pretrained and the fine-tuned policy on each task"
tasks=$(for demos in $DEMOS; do printf '%s,' "${demos%=*}"; done)
tasks=${tasks%,}
checkpoints="$OUT/pretrain/checkpoints/000000/pretrained_model,$OUT/pretrain/checkpoints/last/pretrained_model"
checkpoints="$checkpoints,$OUT/finetune/checkpoints/last/pretrained_model"
"$PYTHON" "$ROOT/eval.py" --policy.path="$checkpoints" --policy.label=untrained,pretrained,finetuned \
    --env.tasks="$tasks" --env.horizon="$HORIZON" --trials="$TRIALS" --seed=$((SEED + 1000)) --workers="$WORKERS" \
    --videos=1 --report=false --out="$OUT/evaluation"

step "report"
robocasa_lerobot report "$OUT/evaluation" --training "$OUT" --demos "$OUT"/demos/*.hdf5 --out "$OUT/report.html"
step "done: open $OUT/report.html in a browser"
