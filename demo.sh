#!/usr/bin/env bash
# Builds the release workspace and runs the demo.   ./demo.sh [FLAGS OF sdr demo]
# For instance: ./demo.sh --no-ballast      ./demo.sh -o json >report.json
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/.ci/missing.sh"

# stdout belongs to the demo: with -o json it holds JSON and nothing else.
{
    need_rust
    # The report names its build; only the CLI reads them, so nothing else is built anew.
    SDR_RUSTC=$(rustc -V)
    export SDR_RUSTC
    if [ -e "$here/.git" ] && SDR_COMMIT=$(git -C "$here" describe --always --dirty --exclude='*'); then
        export SDR_COMMIT
    fi
    # The default members: the agent, the CLI, the components.
    cargo build --release --locked --manifest-path "$here/Cargo.toml"
} >&2
exec "${CARGO_TARGET_DIR:-$here/target}/release/sdr" demo "$@"
