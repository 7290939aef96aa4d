#!/usr/bin/env bash
# Installs LLVM 17 or newer, unless Dr.Jit already has one. Usage: install_llvm.sh PYTHON, with tracer installed in it.
# Tried with apt; dnf and brew are written from their documentation.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/system.sh
source scripts/system.sh

python=$1

usable() {
    "$python" -c '
import sys
from tracer.llvm import MachineError, find_llvm
try:
    find_llvm()
except MachineError:
    sys.exit(1)' </dev/null
}

# The newest package from libllvm17 on, but 19 where it is offered: the version that the tests ran with.
newest_apt_package() {
    apt-cache search --names-only '^libllvm[0-9]+(t64)?$' | awk '{ print $1 }' |
        awk '{ number = $1; gsub(/libllvm|t64/, "", number); number += 0; if (number >= 17) print (number == 19 ? 999 : number), $1 }' |
        sort -rn | awk 'NR == 1 { print $2 }'
}

install_with_apt() {
    local package
    apt_update
    package=$(newest_apt_package)
    [ -n "$package" ] || stop "This system's apt offers no LLVM 17 or newer: use Debian 12, Ubuntu 24.04 or newer, or install one from LLVM's own apt repository (or conda-forge) and set DRJIT_LIBLLVM_PATH to its libLLVM."
    say "installing $package"
    apt_install "$package" || stop "apt-get could not install $package; its message is above."
}

install_with_dnf() {
    say "installing llvm-libs"
    need_root dnf install llvm-libs
    as_root dnf install -y -q llvm-libs </dev/null >&2 || stop "dnf could not install llvm-libs; its message is above."
}

install_with_brew() {
    command -v brew >/dev/null || stop "Homebrew is needed to install LLVM: install it, then run 'make setup' again."
    say "installing llvm"
    brew install --quiet llvm </dev/null >&2 || stop "brew could not install llvm; its message is above."
}

if [ -n "${DRJIT_LIBLLVM_PATH-}" ]; then
    usable || stop "DRJIT_LIBLLVM_PATH=$DRJIT_LIBLLVM_PATH is not the file of an LLVM 17 or newer: correct or unset it."
fi
if usable; then
    exit 0
fi
case $(package_manager) in
    apt) install_with_apt ;;
    dnf) install_with_dnf ;;
    brew) install_with_brew ;;
    *) stop "No package manager that this script knows (apt, dnf, brew): install LLVM 17 or newer and set DRJIT_LIBLLVM_PATH to its libLLVM." ;;
esac
usable || stop "LLVM was installed, but none from version 17 on was found: set DRJIT_LIBLLVM_PATH to its libLLVM."
