#!/bin/sh
# Installs `sweep` for CI, into FOLDER/bin:
#
#     install.sh REPOSITORY TAG FOLDER
#
# A release's static binary if there is one for this system, checked against its digest, else from
# source by cargo. Nothing is done where that version is there already, as a cache brings it back.
set -eu
repository=$1 tag=$2 folder=$3
stamp=$folder/$(printf '%s' "$tag" | tr -c 'a-zA-Z0-9._-' _).tag
[ -e "$stamp" ] && [ -x "$folder/bin/sweep" ] && exit 0
mkdir -p "$folder/bin"
name=sweep-${tag#v}-$(uname -m)-linux
part=$(mktemp -d)
trap 'rm -rf "$part"' EXIT
archive=$repository/releases/download/$tag/$name.tar.gz
if [ "$(uname -s)" = Linux ] && curl -fsSL "$archive" -o "$part/$name.tar.gz" &&
    curl -fsSL "$archive.sha256" -o "$part/$name.tar.gz.sha256"; then
    (cd "$part" && sha256sum -c "$name.tar.gz.sha256" && tar -xzf "$name.tar.gz")
    mv "$part/$name/sweep" "$folder/bin/sweep"
else
    cargo install --git "$repository" --rev "$tag" --locked --root "$folder" sweep
fi
"$folder/bin/sweep" --version
: > "$stamp"
