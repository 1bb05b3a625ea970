#!/usr/bin/env bash
# Fuzzes one decoder.   fuzz/run.sh TARGET|all SECONDS   (docs/fuzzing.md)
# Needs Rust, a C++ compiler for libFuzzer, and nothing else: coverage is asked of the compiler
# with options that a stable one has. `cargo fuzz run TARGET` works on the same folder.
# Makes the seeds, and ends with 1 when an input breaks a promise; it lies in artifacts/TARGET.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

fail() { printf 'fuzz: %s\n' "$1" >&2; exit 1; }

[ $# -eq 2 ] || fail "fuzz/run.sh TARGET|all SECONDS"
[[ $2 =~ ^[0-9]+$ ]] || fail "\`$2\` is no number of seconds"
mapfile -t targets < <(ls fuzz_targets | sed 's/\.rs$//')
[ "$1" = all ] || [[ " ${targets[*]} " == *" $1 "* ]] \
    || fail "no target $1; there are: ${targets[*]}, or all"
[ "$1" = all ] || targets=("$1")
command -v cargo >/dev/null || fail "Rust is missing: https://rustup.rs"
command -v c++ >/dev/null || fail "a C++ compiler is missing: apt-get install g++"

machine=$(rustc -vV | sed -n 's/^host: //p')
coverage="-Cpasses=sancov-module -Ccodegen-units=1 -Cdebug-assertions --cfg fuzzing"
for option in level=4 inline-8bit-counters pc-table trace-compares; do
    coverage+=" -Cllvm-args=-sanitizer-coverage-$option"
done
# With --target, build scripts and macros are left alone.
build=(cargo build --quiet --release --target "$machine")
binaries=target/$machine/release

export RUSTFLAGS=$coverage
"${build[@]}" --bin seeds
"$binaries/seeds" corpus
for target in "${targets[@]}"; do
    "${build[@]}" --bin "$target"
    mkdir -p "corpus/$target" "artifacts/$target"
    # Memory is counted by the targets themselves: no sanitizer, twice the speed.
    "$binaries/$target" "corpus/$target" -artifact_prefix="artifacts/$target/" \
        -max_total_time="$2" -timeout=10 -rss_limit_mb=2048 -max_len=16384 -print_final_stats=1
done
