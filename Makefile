# `make demo` and `make test` are all that a fresh machine needs; both create .venv from requirements.lock first.

SHELL := /bin/sh
.SHELLFLAGS := -eu -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SUFFIXES:

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.stamp
COMPANION := companion/lerobot_policy_robocasa
GENERATION := outputs/generation/sources

# Without bytecode every start of LeRobot takes twice as long.
unexport PYTHONDONTWRITEBYTECODE
unexport PYTHONPATH
export PYTHONUNBUFFERED := 1
export UV_HTTP_TIMEOUT ?= 300
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help setup demo study test test-slow walk lint format lock docs doctor bench bench-convert bench-training bench-evaluation bench-grasps bench-demonstrators bench-demo bench-kitchens bench-kitchen-tasks bench-generation every-task clean

help:  ## this list
	@sed -n 's/^\([a-z-]*\):.*  ## /\1\t/p' Makefile | awk -F '\t' '{printf "  make %-20s %s\n", $$1, $$2}'

setup: $(STAMP)  ## create .venv from requirements.lock and install the package into it

# uv is needed to install uv's fellow packages fast, so its own block of the lock is installed with pip first.
$(STAMP): requirements.lock pyproject.toml $(COMPANION)/pyproject.toml scripts/find_python.sh
	@if ! $(BIN)/python -c 'import sys; raise SystemExit(sys.version_info < (3, 12))' 2>/dev/null; then \
	    python=$$(sh scripts/find_python.sh); \
	    echo "creating $(VENV) with $$python"; \
	    rm -rf $(VENV); \
	    "$$python" -m venv $(VENV); \
	fi
	@if ! $(BIN)/uv --version >/dev/null 2>&1; then \
	    awk '/^[^ ]/ {keep = /^uv==/} keep' requirements.lock > $(VENV)/uv.lock; \
	    $(BIN)/python -m ensurepip >/dev/null; \
	    $(BIN)/python -m pip install --quiet --no-deps --require-hashes -r $(VENV)/uv.lock; \
	fi
	$(BIN)/uv pip sync --quiet --python $(BIN)/python --require-hashes --compile-bytecode requirements.lock
	$(BIN)/uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation -e . ./$(COMPANION)
	@touch $@

demo: $(STAMP)  ## demonstrations, dataset, two training phases, evaluation and report
	PYTHON=$(BIN)/python sh scripts/demo.sh

# About a day on two idle cores, two trainings at once; goes on where it was stopped. PARTS="multitask lifelong" runs some,
# STUDY_ARGS=--plan tells hours and disk, STUDY_ARGS="--device cuda --results docs/results_cuda --page docs/results_cuda.md" is for one GPU.
study: $(STAMP)  ## what small policies learn: trainings from data to trials, and docs/results.md
	$(BIN)/robocasa-lerobot study $(PARTS) --results docs/results --page docs/results.md $(STUDY_ARGS)

test: $(STAMP)  ## the fast tests
	PYTHON=$(BIN)/python sh scripts/test.sh $(PYTEST_ARGS)

test-slow: $(STAMP)  ## the slow and costly tests: every task and kitchen, long trainings
	$(BIN)/python -m pytest -m "slow or costly" $(PYTEST_ARGS)

# 25 minutes on two idle cores; PYTEST_ARGS="-k lifelong" walks some. File, phases and minutes go to outputs/walk.md.
walk: $(STAMP)  ## every experiment file from its first step to its report, at a tiny scale
	WALK_LOG=outputs/walk.md $(BIN)/python -m pytest -m slow tests/training/test_experiments_walk.py $(PYTEST_ARGS)

lint: $(STAMP)  ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(STAMP)  ## rewrite the sources in the project's format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(STAMP)  ## write docs/tasks.md and docs/deviations.md from the declarations of the tasks
	$(BIN)/robocasa-lerobot tasks --markdown docs/tasks.md
	$(BIN)/robocasa-lerobot tasks --deviations docs/deviations.md

doctor: $(STAMP)  ## check this machine
	$(BIN)/robocasa-lerobot doctor

# `make bench BENCH_ARGS=--quick` takes about 5 minutes; the first run makes robosuite's environment as well.
bench: $(STAMP)  ## our simulator beside robosuite's, in one run
	$(BIN)/python benchmarks/sim_speed.py $(BENCH_ARGS)

# `make bench-training BENCH_ARGS=--quick` takes about 15 minutes.
bench-training: $(STAMP)  ## our training beside lerobot-train, and the loaders alone, in one run
	$(BIN)/python benchmarks/training_speed.py $(BENCH_ARGS)

# `make bench-evaluation BENCH_ARGS=--quick` takes about 5 minutes.
bench-evaluation: $(STAMP)  ## our evaluation beside lerobot-eval, in one run
	$(BIN)/python benchmarks/evaluation_speed.py $(BENCH_ARGS)

# `make bench-convert BENCH_ARGS=--quick` takes about 10 minutes.
bench-convert: $(STAMP)  ## our converter beside LeRobot's and the official one, in one run
	$(BIN)/python benchmarks/convert_speed.py $(BENCH_ARGS)

# Takes about 10 minutes; `BENCH_ARGS=--quick` one. Continues where it was stopped.
bench-grasps: $(STAMP)  ## which objects a gripper can lift: every instance, the best of 16 poses
	$(BIN)/python benchmarks/grasps.py $(BENCH_ARGS)

# Goes on with the committed result; BENCH_ARGS='--tasks OpenDrawer --fresh' runs a task again, `--seeds N` makes N of each split.
bench-demonstrators: $(STAMP)  ## how often and how fast each demonstrator solves its task
	$(BIN)/python benchmarks/demonstrators.py $(BENCH_ARGS)

# Takes about an hour; goes on where it was stopped, BENCH_ARGS=--fresh begins again.
bench-demo: $(STAMP)  ## what the demo learns, over three seeds, with 40 trials for each policy and task
	$(BIN)/python benchmarks/demo.py $(BENCH_ARGS)

# Goes on where it was stopped; BENCH_ARGS=--fresh begins again, BENCH_ARGS='--every 31 --out outputs/kitchens.json' takes a sample.
bench-kitchens: $(STAMP)  ## build, check and settle all 2,510 kitchens
	$(BIN)/python benchmarks/kitchens.py $(BENCH_ARGS)

# Keeps the pinned versions that still fit; `make lock LOCK_ARGS=--upgrade` takes the newest ones.
lock: $(STAMP)  ## pin pyproject.toml's dependencies in requirements.lock
	$(BIN)/uv pip compile pyproject.toml --extra dev --extra setup --python-version 3.12 --universal --generate-hashes \
	    --no-emit-index-url --no-emit-find-links --no-annotate --no-header --quiet $(LOCK_ARGS) -o requirements.lock

# About an hour and a half on two cores; goes on where it was stopped, BENCH_ARGS='--every 50 --out outputs/kitchen_tasks.json' takes a sample.
bench-kitchen-tasks: $(STAMP)  ## five composite tasks in each of the 2,510 kitchens: nothing falls, overlaps or blocks
	$(BIN)/python benchmarks/kitchen_tasks.py $(BENCH_ARGS)

# 82 minutes on two cores; goes on where it was stopped. BENCH_ARGS='--tasks atomic_seen' takes some, `--strips 40` draws strips.
every-task: $(STAMP)  ## one demonstration of each of the 365 tasks: recorded, converted, verified, replayed
	$(BIN)/python benchmarks/every_task.py $(BENCH_ARGS)

# Hours; goes on where it was stopped. Ten sources of each of the 60 tasks are recorded and prepared first.
bench-generation: $(STAMP)  ## generated demonstrations beside MimicGen's way and the demonstrators
	$(BIN)/robocasa-lerobot demos --tasks mimicgen60 --episodes 10 --split pretrain --seed 100000 --out $(GENERATION)
	$(BIN)/robocasa-lerobot prepare $(GENERATION)
	$(BIN)/python benchmarks/generation.py --source $(GENERATION) --first-seed 300000 \
	    --arms ours=100,mimicgen=20,scripted=20,far=20,one=20 $(BENCH_ARGS)

clean:  ## remove .venv and outputs/: every training, evaluation and study, not only the demo's
	rm -rf $(VENV) outputs
