#!/usr/bin/env bash
# Run pytest with the Python and the QGIS of a newer Debian, whose packages are unpacked into a
# folder of their own; arguments are pytest's. GROUNDTIE_SUITE names the suite (default: trixie).
# Needs root on a Debian; elsewhere: a failure under GROUNDTIE_REQUIRE_QGIS=1, else skipped.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

suite=${GROUNDTIE_SUITE:-trixie}
folder=$PWD/build/debian-$suite
data=$(realpath -m "${GROUNDTIE_DATA:-../shared/data}")

skip() {
    echo "test_newer_debian.sh: $1: the tests with $suite's QGIS did not run" >&2
    [ "${GROUNDTIE_REQUIRE_QGIS:-}" != 1 ] || exit 1
    exit 0
}

packages=(
    base-files bash coreutils dash libc-bin
    qgis python3-qgis qgis-providers
    python3-numpy python3-scipy python3-rasterio python3-opencv python3-sklearn python3-shapely
    python3-fiona python3-matplotlib python3-jinja2 python3-click
    python3-pytest python3-pytest-xdist python3-hypothesis python3-markdown-it python3-yaml
)

# The system's own source and keys serve for the newer suite, too; its state stays as it is.
unpack() {
    local site
    site=$(apt-get indextargets --format '$(ORIGIN) $(SITE)' | sed -n 's/^Debian //p' | head -1)
    [ -n "$site" ] || return 1
    rm -rf "$folder"
    mkdir -p "$folder"/apt/{state/lists/partial,cache/archives/partial,parts} "$folder/unpacking"
    : >"$folder/apt/state/status"
    echo "deb $site $suite main" >"$folder/apt/sources.list"
    cat >"$folder/apt/apt.conf" <<END
Dir::State "$folder/apt/state";
Dir::State::status "$folder/apt/state/status";
Dir::Cache "$folder/apt/cache";
Dir::Etc::sourcelist "$folder/apt/sources.list";
Dir::Etc::sourceparts "$folder/apt/parts";
Dir::Etc::preferencesparts "$folder/apt/parts";
APT::Install-Recommends "false";
END
    local apt=(env APT_CONFIG="$folder/apt/apt.conf" apt-get -q -y -o Dpkg::Use-Pty=0)
    "${apt[@]}" update >/dev/null && "${apt[@]}" install --download-only "${packages[@]}" \
        >/dev/null || return 1
    # First the one that makes /bin, /lib and /sbin links into /usr.
    local archives=("$folder"/apt/cache/archives/base-files_*.deb)
    archives+=("$folder"/apt/cache/archives/*.deb)
    for archive in "${archives[@]}"; do
        dpkg-deb --fsys-tarfile "$archive" |
            tar --extract --keep-directory-symlink --directory="$folder/unpacking" || return 1
    done
    # What the packages' scripts, which do not run, would have set up.
    printf '/usr/lib/%s-linux-gnu/%s\n' "$(uname -m)" blas "$(uname -m)" lapack \
        >"$folder/unpacking/etc/ld.so.conf.d/alternatives.conf"
    chroot "$folder/unpacking" /usr/sbin/ldconfig || return 1
    mkdir -p "$folder/unpacking"/{proc,dev,repository,data}
    rm -rf "$folder/apt"
    mv "$folder/unpacking" "$folder/root"
}

[ "$(id -u)" -eq 0 ] || skip "needs root"
command -v apt-get >/dev/null || skip "needs apt-get"
[ -d "$folder/root" ] || unpack || skip "$suite's packages cannot be had"

environment=(
    PATH=/usr/bin:/bin HOME=/tmp/home XDG_RUNTIME_DIR=/tmp/home LC_ALL=C.UTF-8
    QT_QPA_PLATFORM=offscreen PYTHONPYCACHEPREFIX=/tmp/home/pycache GROUNDTIE_REQUIRE_QGIS=1
    GROUNDTIE_DATA=/data
)
[ -z "${CI:-}" ] || environment+=("CI=$CI")

# Mounts of a name space of their own end with it: no removal of the folder can follow them.
exec unshare --mount --propagation private bash -euc '
    root=$1 repository=$2 data=$3
    shift 3
    mount --bind /dev "$root/dev"
    mount -t proc proc "$root/proc"
    mount -t tmpfs tmpfs "$root/tmp"
    mkdir -m 700 "$root/tmp/home"
    mount --bind "$repository" "$root/repository"
    [ ! -d "$data" ] || mount --bind "$data" "$root/data"
    exec chroot "$root" /usr/bin/env -i "$@"
' - "$folder/root" "$PWD" "$data" "${environment[@]}" \
    /bin/bash -c 'cd /repository && exec python3 -m pytest "$@"' - "$@"
