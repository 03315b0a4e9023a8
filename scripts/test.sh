#!/bin/sh
# The fast tests, in two processes beside each other where there are two cores; with arguments as pytest takes them.
# Of the costly ones a third, drawn by the commit; with arguments all that these name.
# The parts take about as long as each other; a new folder of tests falls into the second.
set -eu
cd "$(dirname "$0")/.."
PYTHON=${PYTHON:-.venv/bin/python}
FIRST="tests/envs tests/policies tests/training tests/evaluation"

if [ $# -gt 0 ] || [ "$(getconf _NPROCESSORS_ONLN)" -lt 2 ]; then
    [ $# -gt 0 ] || set -- --in-turns
    exec "$PYTHON" -m pytest "$@"
fi
second=
for folder in tests/*/; do
    folder=${folder%/}
    case " $FIRST tests/support tests/__pycache__ " in
        *" $folder "*) ;;
        *) second="$second $folder" ;;
    esac
done
log=$(mktemp)
trap 'rm -f "$log"; kill "$other" 2>/dev/null || true' EXIT
"$PYTHON" -m pytest --in-turns $FIRST >"$log" 2>&1 &
other=$!
status=0
"$PYTHON" -m pytest --in-turns $second || status=$?
wait "$other" || status=$?
cat "$log"
exit "$status"
