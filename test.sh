#!/usr/bin/env bash
# Runs every check, and ends with 1 when any fails.   ./test.sh [STEP...]
# Steps: format lints pure docs tests planted fuzz python. Without a name: all, in this order.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
source .ci/missing.sh

target=${CARGO_TARGET_DIR:-$PWD/target}
venv=$target/venv

format() {
    need_rust_part fmt rustfmt
    cargo fmt --all --check
    cargo fmt --manifest-path fuzz/Cargo.toml --check
}

lints() {
    need_rust_part clippy clippy
    cargo clippy --workspace --all-targets --locked -- -D warnings
}

# The pure crates and all they use, built where no standard library is to be found.
pure() {
    local machine sysroot bare part
    machine=$(rustc -vV | sed -n 's/^host: //p')
    sysroot=$(rustc --print sysroot)/lib/rustlib/$machine/lib
    bare=$target/bare-sysroot
    rm -rf "$bare"
    mkdir -p "$bare/lib/rustlib/$machine/lib"
    for part in core alloc compiler_builtins; do
        ln -s "$sysroot"/lib$part-* "$bare/lib/rustlib/$machine/lib/"
    done
    # With --target, these flags leave macros and build scripts alone: they may use std.
    CARGO_TARGET_DIR=$target/pure RUSTFLAGS="--sysroot=$bare" \
        cargo check --locked --target "$machine" -p sdr-core -p sdr-alloc -p sdr-recovery
}

docs() {
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked
}

# Unit, property, golden, tidy, end-to-end and doc tests. The end-to-end harness builds the
# programs that it starts.
tests() {
    cargo test --workspace --locked --no-fail-fast
}

# Defects planted on purpose are caught. A build of their own, so that none gets into another.
planted() {
    cargo test --locked -p sdr-lab --features planted --test planted
}

# The fuzz targets go with the code; running them is fuzz/run.sh. Nothing is linked: the path
# spares libFuzzer's build.
fuzz() {
    CUSTOM_LIBFUZZER_PATH=$target/libfuzzer.a CARGO_TARGET_DIR=$target/fuzz \
        cargo check --locked --manifest-path fuzz/Cargo.toml
}

# Others can read what the agents write.
python() {
    need_python
    [ -x "$venv/bin/python" ] || python3 -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet --requirement tests/python/requirements.txt
    cargo build --locked -p sdr-agent
    SDR_TEST_AGENT="$target/debug/sdr-agent" SDR_TEST_RECORDINGS="$target/test-recordings" \
        "$venv/bin/python" -m pytest -p no:cacheprovider tests/python
}

steps=(format lints pure docs tests planted fuzz python)
if [ $# -gt 0 ]; then
    for step in "$@"; do
        [[ " ${steps[*]} " == *" $step "* ]] || fail "no step $step; there are: ${steps[*]}"
    done
    steps=("$@")
fi

need_rust
summary=()
failed=0
for step in "${steps[@]}"; do
    printf '\n== %s\n' "$step"
    begun=$SECONDS
    # Not `if ( ... )`: a condition would switch -e off inside.
    set +e
    (set -e; "$step")
    status=$?
    set -e
    if [ $status -eq 0 ]; then word=ok; else word=FAILED failed=1; fi
    summary+=("$(printf '%-8s %-6s %5d s' "$step" "$word" $((SECONDS - begun)))")
done

printf '\n== summary\n'
printf '%s\n' "${summary[@]}"
exit $failed
