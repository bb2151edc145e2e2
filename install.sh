#!/bin/sh
# Installs wallride on a car's computer, or updates it: the same command. Debian, Ubuntu, JetPack.
#
#   sudo sh install.sh              says what it will do, asks, does it
#   sudo sh install.sh --rollback   back to the version before
#
# Each version is a virtual environment of its own in /opt/wallride-versions; /opt/wallride is a link to the one in use,
# switched last and at once, so that a failed installation changes nothing. A service that ran is restarted and watched;
# where it does not become ready, the version before is put back. `wallride deploy` runs this script on the car.
# Exit code: 0 done, 1 or 2 nothing was changed, 3 the version that was to be used is not ready, or a step failed: its
# words say what is in use.
# DESTDIR: another root, for images and tests. SYSTEMCTL: another service manager, for tests.
set -eu
umask 022  # the service's user reads and runs what root makes here

HERE=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
TOP=${DESTDIR:-}
CURRENT=/opt/wallride
VERSIONS=/opt/wallride-versions
COMMAND=/usr/local/bin/wallride
COMPLETION=/usr/share/bash-completion/completions/wallride
UV_PYTHON=3.12
MANAGER=${SYSTEMCTL:-systemctl}
READY_S=60   # for the start of the service, which says "ready" within 15 s, also without devices
SETTLED_S=5  # for which it must then stay up
ANSWER_S=20  # for lidar and motor, where they were ready before
ARCHIVE='' YES='' DRY='' SERVICE=yes COMPILER=yes WHEELHOUSE='' PYTHON='' ROLLBACK='' FORCE='' START='' KEEP=3

usage() {
    cat <<'TEXT'
sudo sh install.sh [OPTION...]
  --yes              do not ask
  --dry-run          only say what it would do
  --rollback         switch back to the version before, and restart the service
  --force            also while the car is armed or drives: it stops for the restart, and comes up disarmed
  --start            start the service, too, where it does not run
  --keep N           versions to keep, 2 or more (default: 3)
  --wheelhouse DIR   take all packages from there; nothing is downloaded, nor taken from the distribution
  --python PROGRAM   use this Python, 3.11 or newer; or a FILE.tar.gz of python-build-standalone, which is unpacked here
  --no-service       do not install the systemd service and the udev rules; a service that runs is restarted
  --no-compiler      do not install gcc; the same laws then run in Python, at half the speed
TEXT
}

say() { printf '%s\n' "$*"; }
fail() { printf 'install.sh: %s\n' "$*" >&2; exit 2; }

while [ $# -gt 0 ]; do
    case $1 in
        --yes) YES=yes ;;
        --dry-run) DRY=yes ;;
        --rollback) ROLLBACK=yes ;;
        --force) FORCE=yes ;;
        --start) START=yes ;;
        --no-service) SERVICE='' ;;
        --no-compiler) COMPILER='' ;;
        --wheelhouse | --python | --keep)
            [ $# -ge 2 ] || fail "$1 needs a value"
            case $1 in --python) PYTHON=$2 ;; --keep) KEEP=$2 ;; *) WHEELHOUSE=$2 ;; esac
            shift ;;
        -h | --help) usage; exit 0 ;;
        *) usage >&2; fail "$1 is not an option" ;;
    esac
    shift
done
case $KEEP in [2-9] | [1-9][0-9]) ;; *) fail "--keep $KEEP: must be 2 to 99, the version in use and the one before" ;; esac

is_new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }
has_venv() { "$1" -c 'import ensurepip, venv' 2>/dev/null; }
has_headers() { "$1" -c 'import sys, sysconfig, os; sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))' 2>/dev/null; }
has_apt() { command -v apt-get >/dev/null 2>&1 && [ -z "$TOP" ] && [ -z "$WHEELHOUSE" ]; }
in_apt() { [ -n "$(apt-cache policy "$1" 2>/dev/null | sed -n 's/^ *Candidate: *//p' | grep -v '(none)')" ]; }
running() { [ -n "${SYSTEMCTL:-}" ] || { [ -z "$TOP" ] && [ -d /run/systemd/system ]; }; }
shows() { "$MANAGER" show wallride --property="$1" --value 2>/dev/null || true; }
target_of() { readlink "$TOP$1" 2>/dev/null || true; }
# The folder of the version in use; below another root the link itself leads nowhere.
in_use() { where=$(target_of "$CURRENT"); printf '%s' "$TOP${where:-$CURRENT}"; }

# A link is replaced by a rename, which readers see whole; one of an installation that was cut off may be there.
point() { rm -rf "$TOP$2.new" && ln -s "$1" "$TOP$2.new" && mv -T "$TOP$2.new" "$TOP$2"; }

# Whether a version is there and whole enough to be started.
is_usable() { [ -n "$1" ] && [ -x "$TOP$1/bin/wallride" ]; }

# Prints the version to go back to: the one before, or where that is gone the newest other one.
version_before() {
    now=$(target_of "$CURRENT") earlier=$(target_of "$VERSIONS/before")
    if is_usable "$earlier" && [ "$earlier" != "$now" ]; then printf '%s' "$earlier"; return; fi
    found=''
    for one in "$TOP$VERSIONS"/by-hand* "$TOP$VERSIONS"/[0-9]*; do  # oldest first
        one=${one#"$TOP"}
        case $one in *by-hand*) ;; *) [ -e "$TOP$one/installed" ] || continue ;; esac
        if is_usable "$one" && [ "$one" != "$now" ]; then found=$one; fi
    done
    printf '%s' "$found"
}

lock() {
    mkdir -p "$TOP$VERSIONS"
    exec 9>"$TOP$VERSIONS/lock"
    flock -n 9 || fail 'another installation is going on here; try again when it has ended'
    chmod 755 "$TOP$VERSIONS"  # also where an older installation ran with a narrow umask
    if [ ! -e "$TOP$CURRENT" ] && [ ! -L "$TOP$CURRENT" ] && [ -d "$TOP$VERSIONS/by-hand" ]; then
        point "$VERSIONS/by-hand" "$CURRENT"  # cut off between moving it and the link to it
    fi
}

# Prints where the car of this computer's settings listens for its programs; nothing where that is not known.
endpoint() {
    "$(in_use)/bin/python" -c '
import sys, tomllib
with open(sys.argv[1], "rb") as file:
    listen = tomllib.load(file)["telemetry"]["listen"]
ends = [end.removeprefix("tcp/").rpartition(":") for end in listen if end.startswith("tcp/")]
for host, _, port in ends[:1]:
    print("tcp/" + {"0.0.0.0": "127.0.0.1", "[::]": "[::1]"}.get(host, host) + ":" + port)
' "$TOP/etc/wallride/car.toml" 2>/dev/null || true
}

# Prints "STATE,LIDAR,MOTOR" of the car that runs here; nothing where none answers.
ask_car() {
    at=$(endpoint)
    cd / && "$(in_use)/bin/wallride" status --json ${at:+--connect "$at"} 2>/dev/null | "$(in_use)/bin/python" -c '
import json, sys
says = json.load(sys.stdin)
state = (says.get("condition") or {}).get("state") or says["state"]
print(state, says["lidar"]["link"], says["motor"]["link"], sep=",")' 2>/dev/null || true
}

refuse_while_driving() {
    BEFORE=''
    [ -e "$(in_use)/bin/wallride" ] || return 0
    BEFORE=$(ask_car)
    [ -z "$FORCE" ] || return 0
    case $BEFORE in
        armed,* | driving,* | limited,* | stopped,*)
            fail "the car is ${BEFORE%%,*}: let go of the permit, so that it is disarmed; or --force" ;;
        '')
            if running && [ "$(shows ActiveState)" = active ]; then
                fail 'the service runs and does not say whether the car is armed: stop it, sudo systemctl stop wallride; or --force'
            fi ;;
    esac
}

is_to_run() {
    running || return 1
    case $(shows ActiveState) in active | activating | reloading | failed) return 0 ;; *) [ -n "$START" ] ;; esac
}

# Whether the car answers, with the devices that were ready before; BEFORE and NOW as of ask_car.
answers_as_before() {
    NOW=$(ask_car)
    [ -n "$NOW" ] || return 1
    had=${BEFORE#*,} has=${NOW#*,}
    { [ "${had%,*}" != ready ] || [ "${has%,*}" = ready ]; } && { [ "${had#*,}" != ready ] || [ "${has#*,}" = ready ]; }
}

# Starts the service with the version in use, and watches it. WHY: why it is not ready.
start_service() {
    say 'starting the service; it comes up disarmed'
    NOW='' waited=0
    if ! timeout "$READY_S" "$MANAGER" restart wallride; then
        WHY="it did not start, or was not ready within $READY_S s"
        return 1
    fi
    process=$(shows MainPID)
    while [ "$waited" -lt "$SETTLED_S" ]; do
        sleep 1
        waited=$((waited + 1))
        [ "$(shows ActiveState) $(shows MainPID)" = "active $process" ] || { WHY='it ended after its start'; return 1; }
    done
    [ -n "$BEFORE" ] || { NOW=$(ask_car); return 0; }
    waited=0
    until answers_as_before; do
        waited=$((waited + 1))
        [ "$waited" -le "$ANSWER_S" ] || { WHY="before it said $BEFORE (state, lidar, motor), now ${NOW:-nothing}"; return 1; }
        sleep 1
    done
}

show_log() { [ -n "${SYSTEMCTL:-}" ] || journalctl --unit wallride --lines 12 --no-pager --output cat 2>/dev/null || true; }

install_service() {
    [ -z "$SERVICE" ] || "$(in_use)/bin/wallride" service install --yes --root "${TOP:-/}" --prefix "$CURRENT"
}

# A version of before may have another unit; where the service was never installed, there is nothing to renew.
renew_service() { [ ! -e "$TOP/etc/systemd/system/wallride.service" ] || install_service || say 'the unit stays as it is'; }

report() {
    note=$(cat "$(in_use)/installed" 2>/dev/null || true)
    say "in use: $(target_of "$CURRENT")${note:+ ($note)}${NOW:+; the car says $NOW (state, lidar, motor)}"
}

rollback() {
    earlier=$(version_before)
    [ -n "$earlier" ] || fail "there is no version before this one in $VERSIONS that could be used: nothing was changed"
    [ "$earlier" = "$(target_of "$VERSIONS/before")" ] || say "the version before is gone: taking $earlier"
    refuse_while_driving
    now=$(target_of "$CURRENT")
    is_to_run && again=yes || again=''
    running && [ "$(shows ActiveState)" = active ] && is_usable "$now" && worked=yes || worked=''
    trap 'say "failed: see  ls -l $VERSIONS $CURRENT, and run it again" >&2; exit 3' EXIT
    point "$earlier" "$CURRENT"
    ! is_usable "$now" || point "$now" "$VERSIONS/before"
    renew_service
    trap - EXIT
    NOW=''
    if [ -n "$again" ] && ! start_service; then
        say "not ready: $WHY"
        show_log
        if [ -n "$worked" ]; then
            say "going back to $now, which ran"
            point "$now" "$CURRENT"
            point "$earlier" "$VERSIONS/before"
            renew_service
            start_service || say "it is not ready any more, either: $WHY"
        fi
        report
        exit 3
    fi
    report
}

# After a step or a start that failed: everything as it was before, the new version gone.
go_back() {
    trap - EXIT INT TERM
    say "not ready: $WHY"
    show_log
    if [ -z "$was_in_use" ]; then
        say "there is no version before this one to go back to: $target stays; run this again, or see  sudo journalctl -u wallride"
        exit 3
    fi
    say "going back to $was_in_use"
    point "$was_in_use" "$CURRENT"
    if [ -n "$was_before" ]; then point "$was_before" "$VERSIONS/before"; else rm -f "$TOP$VERSIONS/before"; fi
    rm -rf "$TOP$target"
    renew_service
    if [ -z "$again" ] || start_service; then report; else say "it is not ready with the version before, either: $WHY"; fi
    exit 3
}

# Sets PYTHON, and adds to PACKAGES and PLAN what is needed for it.
choose_python() {
    case $PYTHON in
        *.tar.gz)
            [ -f "$PYTHON" ] || fail "$PYTHON: is not there"
            ARCHIVE=$PYTHON PYTHON=$TOP$VERSIONS/python/$(basename "$PYTHON" .tar.gz)/bin/python3
            PLAN="unpack $ARCHIVE into ${PYTHON%/bin/python3}"
            return ;;
    esac
    if [ -n "$PYTHON" ]; then
        is_new_enough "$PYTHON" || fail "$PYTHON: is not a Python of 3.11 or newer"
        return
    fi
    for name in python3 python3.13 python3.12 python3.11; do
        if command -v "$name" >/dev/null 2>&1 && is_new_enough "$name"; then PYTHON=$(command -v "$name"); return; fi
    done
    if has_apt; then
        for name in python3 python3.13 python3.12 python3.11; do
            version=$(apt-cache policy "$name" | sed -n 's/^ *Candidate: *//p' | cut -d. -f1,2)
            case $version in
                3.1[1-9] | 3.[2-9][0-9])
                    PYTHON=/usr/bin/$name
                    PACKAGES="$PACKAGES $name $name-venv"
                    return ;;
            esac
        done
    fi
    [ -z "$WHEELHOUSE" ] || fail 'no Python of 3.11 or newer is here, and --wheelhouse downloads none: give --python'
    PYTHON=uv
    PLAN="$PLAN
download uv from the package index, and by it Python $UV_PYTHON (python-build-standalone on GitHub)"
}

by_uv() {
    command -v python3 >/dev/null 2>&1 || fail 'no python3 is here, which brings uv: install the package python3-venv'
    python3 -m venv "$TOP$VERSIONS/uv" 2>/dev/null || fail 'python3 cannot make a venv: apt-get install python3-venv'
    "$TOP$VERSIONS/uv/bin/python" -m pip install --quiet uv
    UV_PYTHON_INSTALL_DIR=$TOP$VERSIONS/python "$TOP$VERSIONS/uv/bin/uv" python install "$UV_PYTHON" ||
        fail "uv could not download Python $UV_PYTHON: name one of 3.11 or newer with --python PROGRAM"
    PYTHON=$(UV_PYTHON_INSTALL_DIR=$TOP$VERSIONS/python "$TOP$VERSIONS/uv/bin/uv" python find "$UV_PYTHON")
}

unpack_python() {
    place=${PYTHON%/bin/python3}
    [ ! -x "$PYTHON" ] || return 0
    rm -rf "$place.new"
    mkdir -p "$place.new"
    tar -xzf "$ARCHIVE" --strip-components=1 -C "$place.new" || { rm -rf "$place.new"; fail "$ARCHIVE: cannot be unpacked"; }
    is_new_enough "$place.new/bin/python3" ||
        { rm -rf "$place.new"; fail "$ARCHIVE: has no bin/python3 of 3.11 or newer that runs on this computer"; }
    rm -rf "$place"
    mv "$place.new" "$place"
}

need_packages() {
    name=$(basename "$PYTHON")
    if has_apt && { [ "$PYTHON" = uv ] || [ -n "$ARCHIVE" ]; }; then
        [ -n "$ARCHIVE" ] || has_venv python3 || PACKAGES='python3 python3-venv'
        [ -z "$COMPILER" ] || command -v gcc >/dev/null 2>&1 || PACKAGES="$PACKAGES gcc libc6-dev"
    fi
    if has_apt && [ "$PYTHON" != uv ] && [ -z "$ARCHIVE" ]; then
        case " $PACKAGES " in
            *" $name-venv "*) ;;
            *) has_venv "$PYTHON" || PACKAGES="$PACKAGES $name-venv" ;;
        esac
        if [ -n "$COMPILER" ]; then
            command -v gcc >/dev/null 2>&1 || PACKAGES="$PACKAGES gcc libc6-dev"
            has_headers "$PYTHON" || PACKAGES="$PACKAGES $name-dev"
        fi
    fi
    PACKAGES=$(echo $PACKAGES)  # without spaces at its ends
    [ -z "$PACKAGES" ] || PLAN="install from the distribution: $PACKAGES
$PLAN"
}

install_packages() {
    [ -z "$PACKAGES" ] || DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends $PACKAGES
}

make_version() {
    target=$VERSIONS/$(date -u +%Y%m%d-%H%M%S)
    [ ! -e "$TOP$target" ] || fail "$target is there already; try again in a second"
    mkdir -p "$TOP$VERSIONS" "$TOP$(dirname "$COMMAND")"
    trap 'rm -rf "$TOP$target"; say "failed: nothing was changed in $CURRENT" >&2' EXIT
    # The environments in which packages are built take these versions as well: by the first variable up to pip 26.1,
    # by the second from pip 25.3 on.
    export PIP_CONSTRAINT="$HERE/constraints.txt" PIP_BUILD_CONSTRAINT="$HERE/constraints.txt"
    [ "$PYTHON" != uv ] || by_uv
    [ -z "$ARCHIVE" ] || unpack_python
    [ ! -d "$TOP$VERSIONS/python" ] || chmod -R go+rX "$TOP$VERSIONS/python"
    what="$HERE[car]"
    [ -e "$HERE/pyproject.toml" ] || what='wallride[car]'  # a deployed folder has a wheel in place of the source
    pip=$(find "${WHEELHOUSE:-/nowhere}" -name 'pip-*.whl' 2>/dev/null | head -n 1)
    if [ -n "$pip" ]; then  # then Debian's package python3-venv is not needed
        "$PYTHON" -m venv --without-pip "$TOP$target"
        # A wheel of Python alone is installed when it is unpacked; out of the file, pip is compiled whenever it runs.
        place=$("$TOP$target/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
        "$TOP$target/bin/python" -m zipfile -e "$pip" "$place"
    else
        "$PYTHON" -m venv "$TOP$target"
    fi
    set -- --quiet --disable-pip-version-check
    [ -z "$WHEELHOUSE" ] || set -- "$@" --no-index --find-links "$WHEELHOUSE"
    "$TOP$target/bin/python" -m pip install "$@" --constraint "$HERE/constraints.txt" "$what"
    "$TOP$target/bin/wallride" --version
    if [ -n "$COMPILER" ] && { [ -z "$WHEELHOUSE" ] || command -v gcc >/dev/null 2>&1; }; then
        # Not from the clone: Python would look at the modules there.
        (cd / && "$TOP$target/bin/wallride" build-kernel --native) || say 'going on in Python: the same laws, at half the speed'
    fi
    # The last file: a version without it is a torso, and goes with the next update.
    { cat "$HERE/build.txt" 2>/dev/null || git -C "$HERE" describe --always --dirty 2>/dev/null || date -u; } >"$TOP$target/installed"
    [ -n "$TOP" ] || sync  # before the switch: a battery that is pulled leaves no half version in use
    refuse_while_driving  # once more: the work took minutes
    trap - EXIT
}

switch() {
    was_in_use=$(target_of "$CURRENT") was_before=$(target_of "$VERSIONS/before")
    if [ -z "$was_in_use" ] && [ -e "$TOP$CURRENT" ]; then
        was_in_use=$VERSIONS/by-hand
        [ ! -e "$TOP$was_in_use" ] || was_in_use=$VERSIONS/by-hand-$(basename "$target")
        mv -T "$TOP$CURRENT" "$TOP$was_in_use"
        point "$was_in_use" "$CURRENT"
    fi
    trap go_back EXIT INT TERM
    is_usable "$was_in_use" || was_in_use=''  # a link to a version that is gone: nothing to go back to
    [ -z "$was_in_use" ] || point "$was_in_use" "$VERSIONS/before"
    point "$target" "$CURRENT"
    point "$CURRENT/bin/wallride" "$COMMAND"
    mkdir -p "$TOP$(dirname "$COMPLETION")"
    "$TOP$target/bin/wallride" completion bash >"$TOP$COMPLETION" || rm -f "$TOP$COMPLETION"
}

# The one in use and the one before stay, and the newest others; torsos go.
prune() {
    in_use=$(target_of "$CURRENT") before=$(target_of "$VERSIONS/before")
    spare=$KEEP
    for one in "$in_use" "$before"; do [ ! -d "$TOP$one/bin" ] || spare=$((spare - 1)); done
    others=0
    for one in "$TOP$VERSIONS"/[0-9]*/installed; do
        case ${one%/installed} in "$TOP$in_use" | "$TOP$before") ;; *) [ ! -e "$one" ] || others=$((others + 1)) ;; esac
    done
    for one in "$TOP$VERSIONS"/[0-9]*; do  # oldest first
        case $one in "$TOP$in_use" | "$TOP$before") continue ;; esac
        if [ ! -e "$one/installed" ]; then
            rm -rf "$one"
        elif [ "$others" -gt "$spare" ]; then
            rm -rf "$one"
            others=$((others - 1))
        fi
    done
}

if [ -n "$ROLLBACK" ]; then
    [ "$(id -u)" = 0 ] || [ -n "$TOP" ] || fail 'run it with sudo'
    lock
    rollback
    exit 0
fi

PACKAGES='' PLAN=''
choose_python
need_packages
PLAN="$PLAN
make $TOP$VERSIONS/DATE, a virtual environment of $PYTHON
install wallride[car] into it, ${WHEELHOUSE:+from $WHEELHOUSE, }in the versions of constraints.txt${COMPILER:+, and compile the hot functions}
point $TOP$CURRENT to it, and $TOP$COMMAND to its command"
[ -z "$SERVICE" ] || PLAN="$PLAN
create the service, its user, /etc/wallride and the udev rules (wallride service install), started at boot"
say "$PLAN" | sed '/^$/d'
[ -z "$DRY" ] || exit 0
[ "$(id -u)" = 0 ] || [ -n "$TOP" ] || fail 'run it with sudo'
if [ -z "$YES" ]; then
    [ -t 0 ] || fail 'nothing done: say --yes'
    printf 'do it? [y/N] '
    read -r answer
    case $answer in y | yes | Y) ;; *) say 'nothing done'; exit 0 ;; esac
fi
lock
refuse_while_driving
install_packages
make_version
is_to_run && again=yes || again=''
WHY='it was interrupted, or a step failed, as it says above'
switch
install_service || { WHY='its service could not be installed'; go_back; }
NOW=''
if [ -n "$again" ]; then start_service || go_back; fi
trap - EXIT INT TERM
prune || say 'not all old versions could be removed'
report
[ -n "$was_in_use" ] || say 'next: edit /etc/wallride/car.toml, then  wallride doctor'
