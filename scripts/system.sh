# Helpers shared by the scripts beside this one; to be sourced.
# shellcheck shell=bash

say() { printf '%s: %s\n' "setup" "$*" >&2; }

stop() {
    say "$*"
    exit 3
}

package_manager() {
    if [ "$(uname -s)" = Darwin ]; then
        echo brew
    elif command -v apt-get >/dev/null; then
        echo apt
    elif command -v dnf >/dev/null; then
        echo dnf
    else
        echo none
    fi
}

# Runs a command as root: directly, or with sudo, which may ask for a password on a terminal.
as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

# Stops unless as_root can work. Usage: need_root COMMAND..., the command that an administrator has to run instead.
need_root() {
    [ "$(id -u)" -eq 0 ] || command -v sudo >/dev/null ||
        stop "Root rights are needed, but sudo is not there: have an administrator run '$*', then run 'make setup' again."
}

# Old lists of packages name files that are gone, hence the update; an unreachable source is no reason to stop.
apt_update() {
    if [ "$(id -u)" -eq 0 ] || command -v sudo >/dev/null; then
        as_root apt-get update -qq </dev/null >&2 || say "the lists of packages could not be refreshed; going on with the old ones"
    fi
}

apt_install() {
    need_root apt-get install "$@"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" </dev/null >/dev/null
}
