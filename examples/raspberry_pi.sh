#!/bin/sh
# Set up a Raspberry Pi (Raspberry Pi OS or Debian 12) to drive a robot, from a clone of this repository:
#
#   sudo examples/raspberry_pi.sh [--user NAME] [--robot robot.toml] [--dry-run]
#
# It installs kmpc in a virtual environment of its own (/opt/kmpc), lets a user open serial ports,
# keeps other programs off them, and writes a systemd unit, which is neither enabled nor started.
# Run it again after each update of the clone: what is right already stays as it is.
set -eu

PREFIX=/opt/kmpc
ETC=/etc/kmpc
UNIT=/etc/systemd/system/kmpc-bridge.service
RULES=/etc/udev/rules.d/60-kmpc.rules
PACKAGES="python3-venv python3-dev gcc libc6-dev"

usage() {
    sed -n '2,8s/^# \{0,1\}//p' "$0"
}

fail() {
    echo "raspberry_pi.sh: $1" >&2
    exit 2
}

clone=$(cd "$(dirname "$0")/.." && pwd)
user=${SUDO_USER:-}
robot=
dry=
while [ $# -gt 0 ]; do
    case $1 in
    --user | --robot)
        [ $# -gt 1 ] || fail "$1: expected a value"
        if [ "$1" = --user ]; then user=$2; else robot=$2; fi
        shift
        ;;
    --dry-run) dry=yes ;;
    -h | --help)
        usage
        exit 0
        ;;
    *) fail "unknown option $1; --help shows what there is" ;;
    esac
    shift
done

run() { # COMMAND ...: run it, or say that it would be
    if [ -n "$dry" ]; then
        echo "would run: $*"
    else
        echo "run: $*"
        "$@"
    fi
}

put() { # FILE MODE: write standard input to FILE, unless it holds that already
    content=$(cat)
    if [ -f "$1" ] && [ "$content" = "$(cat "$1")" ]; then
        echo "kept: $1"
    elif [ -n "$dry" ]; then
        echo "would write: $1"
    else
        mkdir -p "$(dirname "$1")"
        printf '%s\n' "$content" >"$1.new"
        chmod "$2" "$1.new"
        mv "$1.new" "$1"
        echo "wrote: $1"
        changed=yes
    fi
}

[ -f "$clone/pyproject.toml" ] || fail "$clone is no clone of kmpc_lite"
[ -n "$dry" ] || [ "$(id -u)" = 0 ] || fail "needs root: sudo $0 (--dry-run only shows what it does)"
if [ -z "$user" ] || [ "$user" = root ]; then
    fail "--user NAME: expected the user who drives the robot, not root"
fi
id "$user" >/dev/null 2>&1 || fail "--user $user: there is no such user"
[ -z "$robot" ] || [ -f "$robot" ] || fail "--robot $robot: there is no such file"
command -v apt-get >/dev/null || fail "expected Raspberry Pi OS or Debian: there is no apt-get"
if ! python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
    fail "python3 3.11 or newer is needed, $(python3 --version 2>&1) was found"
fi

missing=
for package in $PACKAGES; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing="$missing $package"
done
if [ -n "$missing" ]; then
    run apt-get update -qq
    # shellcheck disable=SC2086 # one word a package
    run env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends $missing
fi

[ -x "$PREFIX/bin/python" ] || run python3 -m venv "$PREFIX"
# built from a copy: what root leaves in a clone, its owner could not write over
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
for part in pyproject.toml README.md LICENSE kmpc_lite firmware_bridge; do
    cp -r "$clone/$part" "$copy/"
done
run "$PREFIX/bin/python" -m pip install --quiet --disable-pip-version-check "${copy}[bridge]"
if [ "$(readlink /usr/local/bin/kmpc || true)" != "$PREFIX/bin/kmpc" ]; then
    run ln -sf "$PREFIX/bin/kmpc" /usr/local/bin/kmpc
fi

if id -nG "$user" | tr ' ' '\n' | grep -qx dialout; then
    echo "kept: $user is in the group dialout"
else
    run usermod -aG dialout "$user"
fi

changed=
put "$RULES" 644 <<EOF
# serial boards: for the group dialout, ignored by ModemManager, USB adapters without their 16 ms wait
SUBSYSTEM=="tty", KERNEL=="ttyACM[0-9]*|ttyUSB[0-9]*|ttyAMA[0-9]*", GROUP="dialout", MODE="0660", ENV{ID_MM_DEVICE_IGNORE}="1"
ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1"
EOF
if [ -n "$changed" ] && command -v udevadm >/dev/null; then
    run udevadm control --reload
    run udevadm trigger --subsystem-match=tty
fi

changed=
put "$UNIT" 644 <<EOF
[Unit]
Description=kmpc drives a robot
After=local-fs.target

[Service]
User=$user
SupplementaryGroups=dialout
RuntimeDirectory=kmpc-bridge
# the emergency stop holds when the service is restarted
RuntimeDirectoryPreserve=yes
Environment=OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 PYTHONUNBUFFERED=1
# more options of kmpc run: KMPC_OPTIONS=--scenario /etc/kmpc/map.toml
EnvironmentFile=-$ETC/options
ExecStart=$PREFIX/bin/kmpc run $ETC/robot.toml \$KMPC_OPTIONS
# SIGTERM brakes, holds and releases; it needs less than this
KillSignal=SIGTERM
TimeoutStopSec=10
# what died must not drive off again by itself
Restart=no
LimitRTPRIO=60
EOF
if [ -n "$changed" ] && [ -d /run/systemd/system ]; then
    run systemctl daemon-reload
fi
if [ -n "$robot" ]; then
    put "$ETC/robot.toml" 644 <"$robot"
fi

echo "next: log in again (group dialout), then"
[ -n "$robot" ] || echo "  kmpc init rover -o robot.toml   # or your board; then sudo $0 --robot robot.toml"
echo "  kmpc check $ETC/robot.toml"
echo "  sudo systemctl start kmpc-bridge   # drives; kmpc estop stops it"
