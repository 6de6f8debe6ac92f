#!/usr/bin/env bash
# What a build of `track` needs beside Rust: checks, and installs what is missing (Debian and its kin, by apt-get).
#
#     scripts/setup.sh           for build, tests and demo
#     scripts/setup.sh --lint    for rustfmt and clippy too
#
# Quick when nothing is missing; may be run as often as you like. Called by every target of the Makefile and by .ci/run.
set -euo pipefail
cd "$(dirname "$0")/.."

# OpenCV with its headers; FFmpeg's libraries that ffmpeg-next links with our features (libopencv-dev brings their
# headers in Debian 12, but that is its own affair); libclang and clang for the bindings, which both crates make from the
# headers; a C++ compiler for OpenCV's; make for .ci/run on a machine that has none.
packages=(
    libopencv-dev
    libavcodec-dev libavformat-dev libavutil-dev libswscale-dev
    libclang-dev clang
    g++ make pkg-config
)

fail() {
    printf 'setup: %s\n' "$@" >&2
    exit 1
}

# rustup puts cargo there, but only login shells learn of it.
PATH="$PATH:${CARGO_HOME:-${HOME:-/root}/.cargo}/bin"

check_rust() {
    local wanted found
    wanted=$(sed -n 's/^rust-version = "\(.*\)"$/\1/p' Cargo.toml)
    command -v cargo >/dev/null || fail \
        "cargo, Rust's build tool, is not installed (or not in PATH)." \
        "Install Rust $wanted or newer with rustup, see https://rustup.rs:" \
        "    curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh" \
        "then open a new shell and try again."
    # rustc 1.95.0 (59807616e 2026-04-14)
    found=$(rustc --version 2>/dev/null | cut -d ' ' -f 2) || found=
    [ -n "$found" ] || fail \
        "cargo is there, but rustc does not run." \
        "Choose a toolchain (rustup default stable), or install Rust with rustup, see https://rustup.rs."
    if [ "$(printf '%s\n%s\n' "$wanted" "${found%%-*}" | sort -V | head -n 1)" != "$wanted" ]; then
        fail "Rust $found is too old: track needs $wanted or newer (Debian's own rustc is older)." \
            "Run: rustup update stable; without rustup, see https://rustup.rs."
    fi
}

check_lint_tools() {
    local missing=()
    cargo fmt --version >/dev/null 2>&1 || missing+=(rustfmt)
    cargo clippy --version >/dev/null 2>&1 || missing+=(clippy)
    [ ${#missing[@]} -gt 0 ] || return 0
    command -v rustup >/dev/null || fail \
        "not installed: ${missing[*]} (parts of Rust). Install Rust with rustup, see https://rustup.rs."
    rustup component add "${missing[@]}"
}

installed() {
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

# Packages of the list that are not there, one a line.
missing_packages() {
    local package
    for package in "${packages[@]}"; do
        installed "$package" || printf '%s\n' "$package"
    done
}

# Where packages have other names: whether the things themselves are there.
missing_things() {
    local thing
    for thing in clang c++ make pkg-config; do
        command -v "$thing" >/dev/null || printf '%s\n' "$thing"
    done
    command -v pkg-config >/dev/null || return 0
    for thing in opencv4 libavcodec libavformat libavutil libswscale; do
        pkg-config --exists "$thing" || printf '%s with its headers\n' "$thing"
    done
}

install_packages() {
    local missing=("$@") as_root=()
    local command="apt-get update && apt-get install -y --no-install-recommends ${missing[*]}"
    command -v apt-get >/dev/null || fail \
        "these packages are missing: ${missing[*]}" \
        "and there is no apt-get here to install them with; install them by hand and try again."
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || fail \
            "these packages are missing: ${missing[*]}" \
            "and to install them takes root, but there is no sudo. As root, run:" \
            "    $command"
        as_root=(sudo)
    fi
    printf 'setup: installing %s\n' "${missing[*]}" >&2
    # As an argument of env, for sudo drops the environment.
    as_root+=(env DEBIAN_FRONTEND=noninteractive)
    { "${as_root[@]}" apt-get update -q &&
        "${as_root[@]}" apt-get install -y -q --no-install-recommends "${missing[@]}"; } >&2 || fail \
        "apt-get could not install ${missing[*]} (see above). As root, run:" \
        "    $command"
}

check_libraries() {
    local missing
    if command -v dpkg-query >/dev/null; then
        mapfile -t missing < <(missing_packages)
        [ ${#missing[@]} -eq 0 ] || install_packages "${missing[@]}"
    else
        mapfile -t missing < <(missing_things)
        [ ${#missing[@]} -eq 0 ] || fail \
            "this is no Debian, so nothing is installed by itself. Missing, by your system's names for them:" \
            "${missing[@]/#/    }" \
            "(OpenCV 4, FFmpeg 5 or newer and libclang, each with headers)"
    fi
}

check_rust
[ "${1:-}" != --lint ] || check_lint_tools
check_libraries
