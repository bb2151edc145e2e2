#!/bin/sh
# Installs wallride on a car's computer, or updates it: the same command. Debian, Ubuntu, JetPack.
#
#   sudo sh install.sh              says what it will do, asks, does it
#   sudo sh install.sh --rollback   back to the version before
#
# Each version is a virtual environment of its own in /opt/wallride-versions; /opt/wallride is a link to the one in use,
# switched last and at once, so that a failed installation changes nothing. DESTDIR: another root, for tests and images.
set -eu

HERE=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd)
TOP=${DESTDIR:-}
CURRENT=/opt/wallride
VERSIONS=/opt/wallride-versions
COMMAND=/usr/local/bin/wallride
COMPLETION=/usr/share/bash-completion/completions/wallride
UV_PYTHON=3.12
YES='' DRY='' SERVICE=yes COMPILER=yes WHEELHOUSE='' PYTHON='' ROLLBACK=''

usage() {
    cat <<'TEXT'
sudo sh install.sh [OPTION...]
  --yes              do not ask
  --dry-run          only say what it would do
  --rollback         switch back to the version before, and restart the service
  --wheelhouse DIR   take all packages from there; nothing is downloaded
  --python PROGRAM   use this Python, 3.11 or newer
  --no-service       do not install the systemd service and the udev rules
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
        --no-service) SERVICE='' ;;
        --no-compiler) COMPILER='' ;;
        --wheelhouse | --python)
            [ $# -ge 2 ] || fail "$1 needs a value"
            if [ "$1" = --python ]; then PYTHON=$2; else WHEELHOUSE=$2; fi
            shift ;;
        -h | --help) usage; exit 0 ;;
        *) usage >&2; fail "$1 is not an option" ;;
    esac
    shift
done

is_new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; }
has_venv() { "$1" -c 'import ensurepip, venv' 2>/dev/null; }
has_headers() { "$1" -c 'import sys, sysconfig, os; sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))' 2>/dev/null; }
has_apt() { command -v apt-get >/dev/null 2>&1 && [ -z "$TOP" ]; }
in_apt() { [ -n "$(apt-cache policy "$1" 2>/dev/null | sed -n 's/^ *Candidate: *//p' | grep -v '(none)')" ]; }
running() { [ -z "$TOP" ] && [ -d /run/systemd/system ]; }

# A link is replaced by a rename, which readers see whole.
point() { ln -s "$1" "$TOP$2.new" && mv -T "$TOP$2.new" "$TOP$2"; }

restart() {
    if running && systemctl is-active --quiet wallride; then
        say 'restarting the service; it comes up disarmed'
        systemctl restart wallride
    fi
}

rollback() {
    before=$TOP$VERSIONS/before
    [ -L "$before" ] || fail 'there is no version before this one'
    now=$(readlink "$TOP$CURRENT")
    earlier=$(readlink "$before")
    point "$earlier" "$CURRENT"
    point "$now" "$VERSIONS/before"
    say "in use: $earlier (before: $now)"
    restart
}

# Sets PYTHON, and adds to PACKAGES and PLAN what is needed for it.
choose_python() {
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

need_packages() {
    name=$(basename "$PYTHON")
    if has_apt && [ "$PYTHON" = uv ]; then
        has_venv python3 || PACKAGES='python3 python3-venv'
        [ -z "$COMPILER" ] || command -v gcc >/dev/null 2>&1 || PACKAGES="$PACKAGES gcc libc6-dev"
    fi
    if has_apt && [ "$PYTHON" != uv ]; then
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
    [ "$PYTHON" != uv ] || by_uv
    "$PYTHON" -m venv "$TOP$target"
    from=''
    [ -z "$WHEELHOUSE" ] || from="--no-index --find-links $WHEELHOUSE"
    # shellcheck disable=SC2086 # two words, or none
    "$TOP$target/bin/python" -m pip install --quiet --disable-pip-version-check $from \
        --constraint "$HERE/constraints.txt" "$HERE[car]"
    "$TOP$target/bin/wallride" --version
    if [ -n "$COMPILER" ]; then
        # Not from the clone: Python would look at the modules there.
        (cd / && "$TOP$target/bin/wallride" build-kernel --native) || say 'going on in Python: the same laws, at half the speed'
    fi
    trap - EXIT
}

switch() {
    if [ -L "$TOP$CURRENT" ]; then
        point "$(readlink "$TOP$CURRENT")" "$VERSIONS/before"
    elif [ -e "$TOP$CURRENT" ]; then
        mv "$TOP$CURRENT" "$TOP$VERSIONS/by-hand"
        point "$VERSIONS/by-hand" "$VERSIONS/before"
    fi
    point "$target" "$CURRENT"
    point "$CURRENT/bin/wallride" "$COMMAND"
    mkdir -p "$TOP$(dirname "$COMPLETION")"
    "$TOP$target/bin/wallride" completion bash >"$TOP$COMPLETION" || rm -f "$TOP$COMPLETION"
    # The one in use and the one before stay; older ones go.
    keep=$(readlink "$TOP$VERSIONS/before" || true)
    for one in "$TOP$VERSIONS"/2*; do
        case ${one#"$TOP"} in "$target" | "$keep") ;; *) rm -rf "$one" ;; esac
    done
}

if [ -n "$ROLLBACK" ]; then
    [ "$(id -u)" = 0 ] || [ -n "$TOP" ] || fail 'run it with sudo'
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
install_packages
make_version
switch
[ -z "$SERVICE" ] || "$TOP$target/bin/wallride" service install --yes --root "${TOP:-/}" --prefix "$CURRENT"
restart
say 'next: edit /etc/wallride/car.toml, then  wallride doctor'
