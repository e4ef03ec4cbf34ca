#!/usr/bin/env bash
# Installs all that the tests need and runs them: the README's second command.
set -euo pipefail
cd "$(dirname "$0")/.."

# A browser for the page, and software OpenGL for the scenes.
missing=()
command -v chromium >/dev/null || missing+=(chromium)
/sbin/ldconfig -p | grep libOSMesa >/dev/null || missing+=(libosmesa6)
if [ ${#missing[@]} -gt 0 ]; then
  if ! command -v apt-get >/dev/null; then
    echo "The tests need ${missing[*]} (Debian's names); install them with your system's tools." >&2
    exit 1
  fi
  as_root=""; [ "$(id -u)" = 0 ] || as_root=sudo
  $as_root apt-get update -qq
  DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq "${missing[@]}" >/dev/null
fi

[ -x .venv/bin/python ] || python3 -m venv .venv
.venv/bin/python -m pip install --quiet --disable-pip-version-check -r requirements-dev.txt
# Only the scene files of these are read, so what their code would need stays away.
.venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps \
  -r requirements-simulators.txt

.venv/bin/ruff check .
.venv/bin/ruff format --check .
.venv/bin/mypy
# A file a process, each on one thread: more would only wait for each other.
export OMP_NUM_THREADS=1
.venv/bin/python -m pytest --numprocesses logical --maxprocesses 4 --dist loadfile --no-loadscope-reorder "$@"
