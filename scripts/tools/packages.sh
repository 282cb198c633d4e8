#!/bin/sh
# Installs missing system packages: scripts/tools/packages.sh PACKAGE ...
#
# The names of packages are those of Debian. Requires root or sudo. On other systems the script
# prints the names of the missing packages.
set -eu
missing=
for package in "$@"; do
    dpkg --status "$package" 2> /dev/null | grep -q '^Status: .* installed$' \
        || missing="$missing $package"
done
[ -n "$missing" ] || exit 0
if ! command -v apt-get > /dev/null; then
    echo "please install what Debian calls:$missing" >&2
    exit 1
fi
as_root=
[ "$(id -u)" = 0 ] || as_root=sudo
# Waits for another installation to end.
apt="$as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=600"
$apt update
# shellcheck disable=SC2086 # A list of words.
$apt install --yes --no-install-recommends $missing > /dev/null
