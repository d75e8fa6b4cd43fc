#!/usr/bin/env bash
# Builds the Python package and tests it in a virtual environment of its own, under the target folder.
set -euo pipefail
cd "$(dirname "$0")"

target="${CARGO_TARGET_DIR:-$PWD/../../target}"
environment="$target/python"
if [ ! -x "$environment/bin/python" ]; then
  python3 -m venv "$environment" || { echo "no Python with venv"; rm -rf "$environment"; exit 1; }
fi
# Versions are those that the package was tested with.
"$environment/bin/pip" install --quiet --disable-pip-version-check -r tests/requirements.txt
export VIRTUAL_ENV="$environment" PATH="$environment/bin:$PATH"
# Beside a build of the workspace, as in .ci/run, the feature saves compiling firsthit a second time.
maturin develop --release --quiet --features as-in-workspace
python -m pytest -q tests "$@"
