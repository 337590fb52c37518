#!/usr/bin/env bash
# Run pytest with the system's Python and packages, QGIS among them; arguments are pytest's.
# Where they cannot be installed: a failure under CI=true or GROUNDTIE_REQUIRE_QGIS=1, else skipped.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if ! scripts/system_packages.sh; then
    if [ "${CI:-}" = true ] || [ "${GROUNDTIE_REQUIRE_QGIS:-}" = 1 ]; then
        echo "test_debian.sh: FAILED: the tests with QGIS and Debian's packages did not run" >&2
        exit 1
    fi
    echo "test_debian.sh: SKIPPED: the tests with QGIS and Debian's packages did not run" >&2
    exit 0
fi

runtime=$(mktemp -d)
trap 'rm -rf "$runtime"' EXIT

# A virtual environment or pyenv on PATH makes QGIS load the wrong Python and crash.
environment=(
    PATH=/usr/bin:/bin HOME="$runtime" XDG_RUNTIME_DIR="$runtime" LC_ALL=C.UTF-8
    QT_QPA_PLATFORM=offscreen GROUNDTIE_REQUIRE_QGIS=1
)
for name in CI GROUNDTIE_DATA GROUNDTIE_PICTURES; do
    [ -z "${!name:-}" ] || environment+=("$name=${!name}")
done
env -i "${environment[@]}" /usr/bin/python3 -m pytest "$@"
