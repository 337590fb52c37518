#!/usr/bin/env bash
# make_venv.sh FOLDER: a virtual environment from the first Python on this machine that is new
# enough and has the venv module; without one, Debian's python3-venv is installed if we may.
set -euo pipefail
folder=$1

make_with() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null &&
        "$1" -m venv --clear "$folder" >/dev/null 2>&1
}

for python in python3.11 python3 python3.12 python3.13 python3.14; do
    # A pyenv shim of a Python that is not active exists but does not run: make_with tells.
    if command -v "$python" >/dev/null && make_with "$python"; then
        exit 0
    fi
done

"$(dirname "${BASH_SOURCE[0]}")/system_packages.sh" python3-venv
make_with /usr/bin/python3 || {
    rm -rf "$folder"
    echo "make_venv.sh: no Python >= 3.10 here can make a virtual environment" >&2
    exit 1
}
