#!/usr/bin/env bash
# Tries regrade on a bare Debian in a chroot. Needs root, debootstrap and some 4 GB; FOLDER is made if it is not there.
#   debian_chroot.sh package FOLDER [SUITE]    makes the Debian package, installs it there and styles a small capture
#   debian_chroot.sh build FOLDER [SUITE]      builds the sources there and runs their tests
# SUITE is bookworm (Debian 12; default) or trixie (Debian 13); a package fits the suite that it was built on. MIRROR names another mirror.
# Exit status: that of the step that failed.
set -euo pipefail

if [[ ${1:-} != package && ${1:-} != build || $# -lt 2 ]]; then
  sed -n '2,6s/^# \{0,1\}//p' "${BASH_SOURCE[0]}" >&2
  exit 2
fi
action=$1 folder=$2 suite=${3:-bookworm}
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
[[ -d $folder/usr/bin ]] || debootstrap --variant=minbase "$suite" "$folder" "${MIRROR:-http://deb.debian.org/debian}"
folder=$(cd "$folder" && pwd)

mount -t proc proc "$folder/proc"
trap 'umount "$folder/proc"' EXIT
# As a user who is not root would meet it, but for the installation.
inside() { chroot "$folder" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"; }

inside apt-get update -qq
rm -rf "$folder/tmp/regrade"
mkdir -p "$folder/tmp/regrade"
if [[ $action == package ]]; then
  cmake --preset cpu -S "$root" >/dev/null
  cmake --build "$root/build/cpu" --target all --parallel "$(nproc)"
  (cd "$root/build/cpu" && cpack -G DEB -B "$root/build/package")
  cp "$root"/build/package/regrade_*.deb "$root/assets/style_sunset.png" "$folder/tmp/regrade"
  inside bash -ec '
    apt-get install -qq -y --no-install-recommends /tmp/regrade/regrade_*.deb
    cd /tmp/regrade
    regrade doctor
    regrade synth s --scene table --views 12 --size 160x120
    regrade run s/images --style style_sunset.png --preset draft --out out
    ls -l out/styled.mp4 /usr/share/man/man1/regrade.1*
    apt-get purge -qq -y regrade'
else
  git -C "$root" archive HEAD | tar -x -C "$folder/tmp/regrade"
  inside bash -ec 'cd /tmp/regrade && scripts/test.sh'
fi
