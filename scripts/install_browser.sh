#!/usr/bin/env bash
# Installs Chromium, in which a test opens the report of `tracer validate`, unless a browser of its family is there.
# Nothing else needs it, so what fails here is said and no error. Tried with apt; dnf is written from its documentation.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/system.sh
source scripts/system.sh

# The names that tests/system/test_report_page.py looks for.
found() { command -v chromium || command -v chromium-browser || command -v google-chrome; } >/dev/null

install_browser() {
    case $(package_manager) in
        apt)
            apt_update
            say "installing chromium, for the tests of the report"
            apt_install chromium
            ;;
        dnf)
            say "installing chromium, for the tests of the report"
            need_root dnf install chromium
            as_root dnf install -y -q chromium </dev/null >&2
            ;;
        *) return 1 ;;
    esac
}

# In a subshell, because need_root stops the script that calls it.
found || (install_browser) || say "there is no chromium, chromium-browser or google-chrome on the path: install one, or the tests of the report's page are skipped; rendering does without."
