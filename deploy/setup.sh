#!/bin/sh
# Make .venv and install netboard into it:  deploy/setup.sh run | light | analysis | notebook | dev | site
#
# light: without Qt, for a machine without windows: server, agents, logger.
# Needs only a Python from 3.11 to 3.13. What else is missing (Debian's venv, the libraries Qt loads) is installed with
# apt-get if we are root or sudo asks for no password; otherwise one line says what to install.
set -eu
cd "$(dirname "$0")/.."

case "${1:-}" in
run) what=".[display]" ;;
light) what="." ;;
analysis) what=".[analysis,dask,display]" ;;
notebook) what=".[analysis,dask,display,notebook]" ;;
dev) what=".[dev,devices]" ;;
site) what=".[dev,devices,site]" ;;
*) echo "usage: deploy/setup.sh run | light | analysis | notebook | dev | site" >&2; exit 2 ;;
esac

say() { echo "setup: $*" >&2; }

can_install() {
    command -v apt-get >/dev/null && { [ "$(id -u)" -eq 0 ] || sudo -n true 2>/dev/null; }
}

apt_install() {
    say "installing $*"
    root=$([ "$(id -u)" -eq 0 ] || echo "sudo -n")
    $root apt-get update -qq
    $root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

find_python() {
    for name in python3.13 python3.12 python3.11 python3 python; do
        if "$name" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null; then
            echo "$name"
            return
        fi
    done
    say "no Python from 3.11 to 3.13 found; install one, for example with: apt-get install python3 python3-venv"
    return 1
}

make_venv() {
    python=$(find_python)
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
        if can_install; then
            apt_install "$package"
        else
            say "$python cannot make a virtual environment; install it with: apt-get install $package"
            return 1
        fi
    fi
    say "making .venv with $("$python" --version)"
    "$python" -m venv --clear .venv
}

# The shared libraries that Qt loads and the system does not have, under Debian's names: a library's package is named
# after its soname, in lower case, with a hyphen between two digits; glib is the exception.
missing_qt_packages() {
    command -v ldd >/dev/null || return 0 # elsewhere the wheel brings all it needs
    qt=$(echo .venv/lib/python3.*/site-packages/PySide6/Qt)
    ldd "$qt"/lib/libQt6Widgets.so.6 "$qt"/lib/libQt6OpenGLWidgets.so.6 "$qt"/lib/libQt6Svg.so.6 \
        "$qt"/plugins/platforms/libqoffscreen.so "$qt"/plugins/platforms/libqxcb.so \
        "$qt"/plugins/xcbglintegrations/*.so 2>/dev/null |
        awk '/not found/ { print tolower($1) }' |
        sed -E 's/^lib(glib|gthread)-2\.0\.so\.0$/libglib2.0-0/; s/([0-9])\.so\.([0-9]+).*/\1-\2/; s/\.so\.([0-9]+).*/\1/' |
        sort -u
}

qt_libraries() {
    packages=$(missing_qt_packages)
    [ -n "$packages" ] || return 0
    if can_install && apt_install $packages && [ -z "$(missing_qt_packages)" ]; then
        return 0
    fi
    say "windows will not open until these are installed: apt-get install" $(missing_qt_packages)
}

# What some tests need beside Python, and are skipped without: JavaScript, network namespaces, systemd-analyze, and a C
# compiler, which also a Touch needs.
test_tools() {
    wanted=""
    command -v node >/dev/null && command -v npm >/dev/null || wanted="nodejs npm"
    command -v ip >/dev/null || [ -x /usr/sbin/ip ] || wanted="$wanted iproute2"
    command -v systemd-analyze >/dev/null || wanted="$wanted systemd"
    command -v cc >/dev/null || command -v gcc >/dev/null || command -v clang >/dev/null || wanted="$wanted gcc libc6-dev"
    [ -n "$wanted" ] || return 0
    if can_install && apt_install $wanted; then
        return 0
    fi
    say "some tests are skipped until these are installed: apt-get install $wanted"
}

# The browser that tests of the documentation site open.
browser() {
    for name in chromium-headless-shell chromium google-chrome; do
        command -v "$name" >/dev/null && return 0
    done
    if can_install && apt_install chromium-headless-shell; then
        return 0
    fi
    say "make test-site needs a browser: apt-get install chromium-headless-shell"
}

.venv/bin/python -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null || make_venv
say "installing netboard and what it needs into .venv"
.venv/bin/python -m pip install --quiet --disable-pip-version-check --constraint requirements/constraints.txt --editable "$what"
[ "$1" = light ] || qt_libraries
case "$1" in dev | site) test_tools ;; esac
[ "$1" != site ] || browser
