# What `wallride deploy` runs on the car, as the user of the ssh session: sh -c THIS on_car.sh ACTION [ARGUMENT...]
# Needs coreutils, util-linux and tar. Everything is copied below $FOLDER; only install.sh changes the system.
set -u
TOP=${DESTDIR:-}
VERSIONS=$TOP/opt/wallride-versions
CURRENT=$TOP/opt/wallride
FOLDER=${XDG_CACHE_HOME:-$HOME/.cache}/wallride/deploy
MANAGER=${SYSTEMCTL:-systemctl}

free_kb() {  # of the file system on which a path is, or will be
    place=$1
    while [ ! -d "$place" ]; do place=$(dirname "$place"); done
    df -Pk "$place" | awk 'NR == 2 { print $4 }'
}

# endpoint VERSION: where the car of this computer's settings listens for its programs; as in install.sh.
endpoint() {
    "$1/bin/python" -c '
import sys, tomllib
with open(sys.argv[1], "rb") as file:
    listen = tomllib.load(file)["telemetry"]["listen"]
ends = [end.removeprefix("tcp/").rpartition(":") for end in listen if end.startswith("tcp/")]
for host, _, port in ends[:1]:
    print("tcp/" + {"0.0.0.0": "127.0.0.1", "[::]": "[::1]"}.get(host, host) + ":" + port)
' "$TOP/etc/wallride/car.toml" 2>/dev/null
}

facts() {
    echo "machine=$(uname -m)"
    echo "libc=$(getconf GNU_LIBC_VERSION 2>/dev/null)"
    for python in python3 python3.14 python3.13 python3.12 python3.11 \
        /opt/wallride-versions/python/*/bin/python3 $CURRENT/bin/python; do
        python=$(command -v "$python" 2>/dev/null) || continue
        "$python" -c 'import os, sys, venv
print("python=%d.%d.%d %s" % (*sys.version_info[:3], os.path.realpath(getattr(sys, "_base_executable", sys.executable))))' 2>/dev/null
    done
    if [ "$(id -u)" = 0 ] || [ -n "$TOP" ]; then echo root=yes
    elif ! command -v sudo >/dev/null 2>&1; then echo root=no
    elif sudo -n true 2>/dev/null; then echo root=sudo
    else echo root=password
    fi
    where=$(readlink "$CURRENT" 2>/dev/null)
    where=$TOP${where:-/opt/wallride}
    [ ! -e "$where/bin/wallride" ] || echo "in_use=${where#"$TOP"}"
    for one in "$VERSIONS"/[0-9]*/installed; do
        [ ! -e "$one" ] || { one=${one%/installed}; echo "version=${one#"$TOP"} $(head -n 1 "$one/installed")"; }
    done
    echo "before=$(readlink "$VERSIONS/before" 2>/dev/null)"
    if [ -e "$TOP/etc/systemd/system/wallride.service" ]; then
        echo "service=$("$MANAGER" show wallride --property=ActiveState --value 2>/dev/null)"
    fi
    if [ -e "$VERSIONS/lock" ] && ! flock -n "$VERSIONS/lock" true; then echo busy=yes; fi
    echo "free_versions_kb=$(free_kb "$VERSIONS")"
    echo "free_copies_kb=$(free_kb "$FOLDER")"
    echo "compiler=$(command -v gcc)"
    for tool in tar sha256sum flock setsid; do command -v $tool >/dev/null 2>&1 || echo "missing=$tool"; done
    [ ! -e "$where/bin/wallride" ] || at=$(endpoint "$where")
    [ ! -e "$where/bin/wallride" ] || (cd / && "$where/bin/wallride" status --json ${at:+--connect "$at"} 2>/dev/null) |
        "$where/bin/python" -c 'import json, sys
says = json.load(sys.stdin)
print("state=" + ((says.get("condition") or {}).get("state") or says["state"]))' 2>/dev/null
    echo end=yes
}

# absent: of a manifest on standard input (sha256sum's format), the lines whose wheel is not here in full already.
absent() {
    mkdir -p "$FOLDER/wheels" && cd "$FOLDER/wheels" || exit 1
    find "$FOLDER" -maxdepth 1 -name 'd-*' -mmin +1440 -exec rm -rf {} +  # of deployments that were cut off
    while read -r sum name; do
        [ "$(sha256sum "$name" 2>/dev/null | cut -d ' ' -f 1)" = "$sum" ] || echo "$name"
    done
}

# receive ID: a tar archive on standard input, into a folder of this deployment alone; its wheels join the others.
receive() {
    umask 022
    mkdir -p "$FOLDER/wheels" "$FOLDER/$1" && cd "$FOLDER/$1" || exit 1
    tar -xf - || { rm -rf "${FOLDER:?}/$1"; exit 1; }
    for name in common/*.whl; do [ ! -e "$name" ] || mv -f "$name" "$FOLDER/wheels/"; done
    mkdir -p wheelhouse
    while read -r _ name; do
        case $name in wheelhouse/*) [ -e "$name" ] || ln -f "$FOLDER/wheels/${name#wheelhouse/}" "$name" || exit 1 ;; esac
    done <manifest
    sha256sum --quiet --check manifest || { echo 'the copy is damaged or incomplete' >&2; exit 1; }
    cd "$FOLDER/wheels" || exit 1  # of wheels that this version does not need, none stays
    for name in *.whl; do grep -q "wheelhouse/$name\$" "../$1/manifest" || rm -f "$name"; done
}

# may_sudo: whether the password on standard input is the right one.
may_sudo() { sudo -k -S -p '' true; }

# install ID root|sudo|password ARGUMENT...: runs install.sh; a connection that ends does not end it.
install() {
    cd "$FOLDER/$1" || exit 1
    id=$1 how=$2
    shift 2
    : >log
    rm -f code
    case $how in
        root) set -- sh install.sh "$@" ;;
        sudo) set -- sudo -n sh install.sh "$@" ;;
        password) set -- sudo -k -S -p '' sh install.sh "$@" ;;
    esac
    exec 3<&0  # a background command would read /dev/null; the first line is sudo's password
    setsid sh -c 'head -n 1 | { "$@" >log 2>&1; echo $? >code; }' install.sh "$@" <&3 >/dev/null 2>&1 &
    tail -n +1 -s 0.2 -f --pid=$! log
    wait "$!" || true  # without a reader tail ends first, and the installation needs its folder
    code=$(cat code 2>/dev/null || echo 1)
    cd / && rm -rf "${FOLDER:?}/$id"
    exit "$code"
}

action=$1
shift
"$action" "$@"
