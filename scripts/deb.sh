#!/usr/bin/env bash
# A Debian package of `track`, target/debian/track_VERSION_ARCH.deb, for the Debian that it is made on: program, manual pages,
# completions, documentation, example scenes. What goes where says Cargo.toml, [package.metadata.deb].
set -euo pipefail
cd "$(dirname "$0")/.."

# The release that this was tried with.
cargo_deb_version=3.8.0

# rustup puts cargo there, but only login shells learn of it.
PATH="$PATH:${CARGO_HOME:-${HOME:-/root}/.cargo}/bin"

fail() {
    printf 'deb: %s\n' "$@" >&2
    exit 1
}

# dpkg-shlibdeps tells which packages hold the libraries.
command -v dpkg-shlibdeps >/dev/null || fail \
    "dpkg-shlibdeps is not installed; it finds the libraries that the package depends on." \
    "On Debian: apt-get install dpkg-dev"
if ! command -v cargo-deb >/dev/null; then
    printf 'deb: installing cargo-deb %s with cargo (some minutes, once)\n' "$cargo_deb_version" >&2
    cargo install --locked "cargo-deb@$cargo_deb_version"
fi

cargo build --release --locked
program=target/release/track
rm -rf target/deb
mkdir -p target/deb/completions
"$program" --quiet man target/deb/man
"$program" completions bash >target/deb/completions/track.bash
"$program" completions zsh >target/deb/completions/_track
"$program" completions fish >target/deb/completions/track.fish
rm -f target/debian/track_*.deb
cargo deb --no-build --locked
