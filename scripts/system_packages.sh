#!/usr/bin/env bash
# Make sure that Debian packages are installed: those named, by default all that the tests with
# Debian's Python and QGIS need. Exits 1 with one line where they are missing and we may not install.
set -euo pipefail

# Two targets may ask at once; dpkg takes one.
exec 9<"${BASH_SOURCE[0]}"
flock 9

packages=("$@")
if [ ${#packages[@]} -eq 0 ]; then
    packages=(
        qgis python3-qgis qgis-providers
        python3-numpy python3-scipy python3-rasterio python3-opencv python3-sklearn python3-shapely
        python3-fiona python3-matplotlib python3-jinja2 python3-click
        python3-pytest python3-hypothesis python3-markdown-it python3-yaml python3-distributed
    )
fi

is_installed() {
    [ "$(dpkg-query --show --showformat='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

missing=()
for package in "${packages[@]}"; do
    is_installed "$package" || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

root=()
if [ "$(id -u)" -ne 0 ]; then
    root=(sudo -n)
fi
if ! command -v apt-get >/dev/null || ! "${root[@]}" true 2>/dev/null; then
    echo "system_packages.sh: please install these packages (Debian's names): ${missing[*]}" >&2
    exit 1
fi

echo "system_packages.sh: installing ${missing[*]}"
noninteractive=("${root[@]}" env DEBIAN_FRONTEND=noninteractive)
apt_get=("${noninteractive[@]}" apt-get -q -y)
# An installation that was interrupted is ended first: apt-get refuses to work before.
"${noninteractive[@]}" dpkg --configure -a
# A third-party source that does not answer must not stop Debian's own packages.
"${apt_get[@]}" update || echo "system_packages.sh: apt-get update failed, trying to install" >&2
"${apt_get[@]}" install --no-install-recommends "${missing[@]}"
