#!/usr/bin/env bash
# The figures of the README: the demo with and without ballast, and an agent alone.
#   benches/demo.sh [RUNS]        10 runs each by default, about 12 minutes
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
runs=${1:-10}
# As in demo.sh: the report names its build.
SDR_RUSTC=$(rustc -V)
export SDR_RUSTC
if [ -e .git ] && SDR_COMMIT=$(git describe --always --dirty --exclude='*'); then
    export SDR_COMMIT
fi
cargo build --release --locked --quiet
bench() { cargo run --release --locked --quiet -p sdr-benches --bin "$@"; }
bench agent
echo
bench demo -- --runs "$runs" --no-ballast
echo
bench demo -- --runs "$runs"
