# Read by demo.sh and test.sh: installs what a build needs and this machine lacks.
# Nothing is touched when all is there. Only Debian's own packages are installed.

fail() {
    echo "$(basename "$0"): $*" >&2
    exit 1
}

# install_packages NAME...
install_packages() {
    local root=()
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || fail "needs the packages: $*. Install them as root, then try again."
        root=(sudo)
    fi
    command -v apt-get >/dev/null || fail "needs what Debian calls: $*. Install it, then try again."
    echo "installing: $*"
    "${root[@]}" apt-get update -qq
    "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

# need_rust: cargo itself checks the version that Cargo.toml asks for.
need_rust() {
    if ! command -v cargo >/dev/null && [ -x "$HOME/.cargo/bin/cargo" ]; then
        PATH="$HOME/.cargo/bin:$PATH"
    fi
    command -v cargo >/dev/null || fail "cargo not found: install Rust 1.95 or newer with rustup (https://rustup.rs)."
    command -v cc >/dev/null || install_packages gcc libc6-dev
}

# need_rust_part COMMAND PART: rustfmt and clippy, when Rust was installed without them.
need_rust_part() {
    cargo "$1" --version >/dev/null 2>&1 && return
    command -v rustup >/dev/null || fail "cargo $1 not found: install the part $2 of Rust."
    rustup component add "$2"
}

# need_python: 3.11 or newer, with venv.
need_python() {
    if ! command -v python3 >/dev/null || ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
        install_packages python3 python3-venv
    fi
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
        fail "needs Python 3.11 or newer; this is $(python3 --version)."
}
