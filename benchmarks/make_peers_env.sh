#!/usr/bin/env bash
# make_peers_env.sh [FOLDER]: environments of the peers that `speed` compares with, by default in
# benchmarks/.peers. A peer that cannot be installed is told and left out.
set -uo pipefail
folder=${1:-$(dirname "${BASH_SOURCE[0]}")/.peers}
mkdir -p "$folder"
missing=0

# peer NAME PYTHON VENV_OPTION… -- PACKAGE…
peer() {
    local name=$1 python=$2 options=()
    shift 2
    while [ "$1" != -- ]; do
        options+=("$1")
        shift
    done
    shift
    local venv=$folder/$name
    if [ -e "$venv/.installed" ]; then
        echo "$name: already there"
    elif "$python" -m venv --clear "${options[@]}" "$venv" >"$venv.log" 2>&1 &&
        "$venv/bin/python" -m pip install "$@" >>"$venv.log" 2>&1; then
        touch "$venv/.installed"
        echo "$name: installed"
    else
        echo "$name: cannot be installed, see $venv.log" >&2
        missing=1
    fi
}

peer simpleitk /usr/bin/python3 -- SimpleITK rasterio

# AROSICS needs GDAL's Python module, which must match Debian's libgdal: package python3-gdal.
gdal=$(/usr/bin/python3 -c 'import osgeo.gdal; print(osgeo.gdal.__version__)' 2>/dev/null)
peer arosics /usr/bin/python3 --system-site-packages -- arosics "gdal==${gdal:-3.6.2}" 'numpy<2'

exit $missing
