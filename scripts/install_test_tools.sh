#!/bin/sh
# Installs what the fault tests drive: strace, unshare and mount (Debian: strace, util-linux, mount).
set -eu
missing=
for tool in strace unshare mount; do
    command -v "$tool" >/dev/null || missing=yes
done
if [ -n "$missing" ]; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends strace util-linux mount >/dev/null
fi
