#!/usr/bin/env bash
# Makes .venv with the package and all development tools, then sees to an LLVM that Dr.Jit can use and to a browser.
# A second run finds everything done. PYTHON=/path/to/python3 picks the interpreter of a new environment.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/system.sh
source scripts/system.sh

venv=.venv
stamp=$venv/.setup-done

# True for a Python 3.10 to 3.13 that runs (a pyenv shim may not). With "venv": that can make environments, too.
suits() {
    "$1" - "${2-}" >/dev/null 2>&1 <<'PYTHON'
import sys
if sys.argv[1] == "venv":
    import ensurepip, venv
sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))
PYTHON
}

# Prints the newest suitable Python; all places on the path count, since a shim may hide the system's own.
find_python() {
    local name candidate
    for name in ${PYTHON:-python3.13 python3.12 python3.11 python3.10 python3}; do
        while read -r candidate; do
            if suits "$candidate" "${1-}"; then
                echo "$candidate"
                return
            fi
        done < <(type -ap "$name")
    done
    return 1
}

# Debian and Ubuntu keep what makes environments in a package of its own; elsewhere Python itself is missing or too new.
install_python() {
    local python package
    case $(package_manager) in
        apt)
            if python=$(find_python); then
                package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
            else
                package=python3-venv
            fi
            apt_update
            say "installing $package"
            apt_install "$package"
            ;;
        dnf)
            say "installing python3.13"
            need_root dnf install python3.13
            as_root dnf install -y -q python3.13 </dev/null >&2
            ;;
        brew)
            say "installing python@3.13"
            brew install --quiet python@3.13 </dev/null >&2
            ;;
    esac || say "that failed; its message is above"
}

create_environment() {
    local python
    if ! python=$(find_python venv); then
        install_python
        python=$(find_python venv) ||
            stop "No Python 3.10 to 3.13 that can make virtual environments was found: install one (for example with the package manager, pyenv or uv) and run 'make setup PYTHON=/path/to/python3'."
    fi
    say "creating $venv with $("$python" --version)"
    "$python" -m venv --clear "$venv"
}

install_packages() {
    say "installing the package and its tools into $venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --editable '.[dev]' ||
        stop "pip could not install the packages; its message is above, and 'make setup' tries again."
}

# The stamp holds the place, because an environment that was moved or copied no longer works.
if [ "$(cat "$stamp" 2>/dev/null)" != "$PWD" ] || [ pyproject.toml -nt "$stamp" ] || ! suits "$venv/bin/python"; then
    if ! suits "$venv/bin/python" || { [ -e "$stamp" ] && [ "$(cat "$stamp")" != "$PWD" ]; }; then
        create_environment
    fi
    install_packages
    # Here, not after every setup: where no browser can be installed, one attempt and one sentence are enough.
    bash scripts/install_browser.sh
    echo "$PWD" >"$stamp"
fi

bash scripts/install_llvm.sh "$venv/bin/python"
