#!/usr/bin/env bash
# make_venv.sh FOLDER: a virtual environment from the first Python on PATH that is new enough and
# has the venv module; without one, Debian's python3-venv is installed if we may.
set -euo pipefail
folder=$1

make_venv() {
    local python
    local candidates
    mapfile -t candidates < <(type -aP python3.11 python3 python3.12 python3.13 python3.14)
    for python in "${candidates[@]}"; do
        # A pyenv shim of a Python that is not active exists but does not run.
        if "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null &&
            "$python" -m venv --clear "$folder" >/dev/null 2>&1; then
            return 0
        fi
    done
    return 1
}

make_venv && exit 0
"$(dirname "${BASH_SOURCE[0]}")/system_packages.sh" python3-venv && make_venv && exit 0
rm -rf "$folder"
echo "make_venv.sh: no Python >= 3.11 here can make a virtual environment" >&2
exit 1
