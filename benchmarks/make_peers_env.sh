#!/usr/bin/env bash
# make_peers_env.sh [FOLDER]: environments of the peers that `speed` and `methods` compare with, by
# default in benchmarks/.peers. A peer that cannot be installed is told and left out.
set -uo pipefail
folder=${1:-$(dirname "${BASH_SOURCE[0]}")/.peers}
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
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
        timeout "${PEER_TIME_LIMIT:-600}" "$venv/bin/python" -m pip install "$@" \
            >>"$venv.log" 2>&1 &&
        add_packages "$name" >>"$venv.log" 2>&1; then
        touch "$venv/.installed"
        echo "$name: installed"
    else
        echo "$name: cannot be installed, see $venv.log" >&2
        missing=1
    fi
}

# What a peer needs besides wheels. The Orfeo ToolBox is unpacked from Debian's packages into the
# peer's own folder: nothing is installed into the system, and no rights are needed.
add_packages() {
    [ "$1" = otb ] || return 0
    local wanted
    wanted=$(apt-get --simulate install --no-install-recommends otb-bin | awk '/^Inst/ {print $2}')
    [ -n "$wanted" ] || return 1
    mkdir -p "$folder/otb/packages" "$folder/otb/root" &&
        cd "$folder/otb/packages" &&
        # shellcheck disable=SC2086 # a list of names
        apt-get download $wanted &&
        for package in *.deb; do dpkg-deb --extract "$package" ../root || return 1; done
    local result=$?
    rm -rf "$folder/otb/packages"
    cd "$folder" || return 1
    return $result
}

peer simpleitk /usr/bin/python3 -- SimpleITK rasterio
peer skimage /usr/bin/python3 -- scikit-image rasterio
peer opencv /usr/bin/python3 -- 'opencv-python-headless<5' rasterio
peer otb /usr/bin/python3 -- rasterio

# RPCs; rpcm may need libtiff's headers (package libtiff-dev).
peer orthority /usr/bin/python3 -- orthority
peer rpcm /usr/bin/python3 -- rpcm

# AROSICS needs GDAL's Python module, which must match Debian's libgdal: package python3-gdal.
gdal=$(/usr/bin/python3 -c 'import osgeo.gdal; print(osgeo.gdal.__version__)' 2>/dev/null)
peer arosics /usr/bin/python3 --system-site-packages -- arosics "gdal==${gdal:-3.6.2}" 'numpy<2'

# The largest by far, hence last: 1.6 GB.
peer elastix /usr/bin/python3 -- itk-elastix rasterio

exit $missing
