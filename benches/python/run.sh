#!/usr/bin/env bash
# Builds the Python package, and times it beside the engines of requirements.txt on one core: run.sh [--...] MODEL...
# All in a virtual environment of its own, under the target folder. CORE=n binds it to another core than 1.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"

target="${CARGO_TARGET_DIR:-$here/../../target}"
environment="$target/python-benches"
if [ ! -x "$environment/bin/python" ]; then
  python3 -m venv "$environment" || { echo "no Python with venv"; rm -rf "$environment"; exit 1; }
fi
"$environment/bin/pip" install --quiet --disable-pip-version-check -r "$here/requirements.txt"
export VIRTUAL_ENV="$environment" PATH="$environment/bin:$PATH"
(cd "$here/../../crates/python" && maturin develop --release --quiet --features as-in-workspace)

# One thread for all, whatever they count their threads by.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 TBB_NUM_THREADS=1 IGL_NUM_THREADS=1 RAYON_NUM_THREADS=1
exec taskset -c "${CORE:-1}" python "$here/queries.py" "$@"
