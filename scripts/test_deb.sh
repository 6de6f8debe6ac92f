#!/usr/bin/env bash
# Installs target/debian/track_*.deb in a bare Debian 12 and measures the demo scene there.
#
#     scripts/test_deb.sh [BASE]
#
# BASE: a folder that `debootstrap --variant=minbase bookworm BASE` made; without it one is made (some 100 MB to download). As
# root; needs debootstrap. All of it happens in a temporary folder, which goes again.
set -euo pipefail
cd "$(dirname "$0")/.."

fail() {
    printf 'test_deb: %s\n' "$@" >&2
    exit 1
}

mapfile -t packages < <(compgen -G 'target/debian/track_*.deb')
[ ${#packages[@]} -eq 1 ] || fail "there are ${#packages[@]} packages target/debian/track_*.deb, not one; run: make deb"
[ "$(id -u)" -eq 0 ] || fail "a chroot takes root; run: sudo $0"
base=${1:-}
[ -n "$base" ] || command -v debootstrap >/dev/null || fail "debootstrap is not installed; run: apt-get install debootstrap"

work=$(mktemp -d)
root=$work/root
clean_up() {
    if mountpoint -q "$root/proc"; then umount "$root/proc"; fi
    rm -rf --one-file-system "$work"
}
trap clean_up EXIT

if [ -n "$base" ]; then
    cp -a "$base" "$root"
else
    debootstrap --variant=minbase bookworm "$root" >&2
fi
cat >"$root/etc/apt/sources.list" <<'END'
deb http://deb.debian.org/debian bookworm main
deb http://deb.debian.org/debian bookworm-updates main
deb http://deb.debian.org/debian-security bookworm-security main
END
cp /etc/resolv.conf "$root/etc/resolv.conf"
mount -t proc proc "$root/proc"
cp "${packages[0]}" "$root/root/"

in_chroot() {
    env -i HOME=/root DEBIAN_FRONTEND=noninteractive PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        chroot "$root" "$@"
}

in_chroot apt-get update -q
in_chroot bash -c 'cd /root && apt-get install -y -q --no-install-recommends ./track_*.deb'
in_chroot track --version
for file in man/man1/track.1.gz man/man1/track-fit.1.gz bash-completion/completions/track zsh/vendor-completions/_track \
    fish/vendor_completions.d/track.fish doc/track/README.md track/examples/steel_ball.scene.json; do
    [ -s "$root/usr/share/$file" ] || [ -s "$root/usr/share/${file%.gz}" ] || fail "the package lacks /usr/share/$file"
done
in_chroot track simulate /usr/share/track/examples/steel_ball.scene.json --out /root/demo
in_chroot track /root/demo/steel_ball.mp4 --calib /root/demo/steel_ball.calib.json --out /root/demo
in_chroot track fit /usr/share/track/examples/kharaz2001.csv --out /root/fit >/dev/null
for file in demo/steel_ball.result.json demo/steel_ball.report.html fit/fit.json fit/report.html; do
    [ -s "$root/root/$file" ] || fail "no $file"
done
printf 'test_deb: %s installs in a bare Debian 12, and the demo is measured there\n' "${packages[0]##*/}"
