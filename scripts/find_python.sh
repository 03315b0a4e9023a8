#!/bin/sh
# Prints the path of a Python 3.12 or 3.13 that can make virtual environments; says what to do when there is none.
# requirements.lock has no wheels of NumPy for later versions.
# Order: $PYTHON, the PATH, pyenv's versions, uv's. Each candidate is run, because a pyenv shim on the PATH may
# stand for a version that is not active.
set -u

usable() {
    "$1" -c 'import sys, venv, ensurepip; raise SystemExit(not (3, 12) <= sys.version_info < (3, 14))' >/dev/null 2>&1
}

real_path() {
    "$1" -c 'import sys; print(sys.executable)'
}

if [ -n "${PYTHON:-}" ]; then
    if usable "$PYTHON"; then real_path "$PYTHON"; exit 0; fi
    echo "PYTHON=$PYTHON is not a Python 3.12 or 3.13 with the modules venv and ensurepip." >&2
    exit 1
fi

# 3.12 first: the version that the tests run on.
for name in python3.12 python3.13 python3 python; do
    if usable "$name"; then real_path "$name"; exit 0; fi
done
for name in 3.12 3.13; do
    for candidate in "${PYENV_ROOT:-$HOME/.pyenv}/versions/$name".*/bin/python; do
        if usable "$candidate"; then echo "$candidate"; exit 0; fi
    done
done
if command -v uv >/dev/null 2>&1; then
    candidate=$(uv python find --no-project '>=3.12,<3.14' 2>/dev/null) ||
        { uv python install 3.12 >&2 && candidate=$(uv python find --no-project '>=3.12,<3.14' 2>/dev/null); }
    if [ -n "${candidate:-}" ] && usable "$candidate"; then echo "$candidate"; exit 0; fi
fi

cat >&2 <<'END'
No Python 3.12 or 3.13 with the modules venv and ensurepip found: not on the PATH, not in pyenv, not in uv.
Install one, then run make again:
  Ubuntu >= 24.04, Debian >= 13:  apt-get install --yes python3 python3-venv
  anything with pyenv:            pyenv install 3.12
  anything with pip:              pip install uv && uv python install 3.12
or name one:                      make PYTHON=/path/to/python3.12
END
exit 1
