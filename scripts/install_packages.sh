#!/usr/bin/env bash
# Installs the Debian 12 packages that regrade is built with and runs on; does nothing when all are there.
#   install_packages.sh [--browser] [--dev] [--ask]
# --browser adds Chromium and ffmpeg, to test pages with; --dev these, clang-format and clang-tidy; --ask asks first, where
# somebody can answer
set -euo pipefail

packages=(
  g++ cmake ninja-build pkg-config python3   # to build
  libgtest-dev python3-numpy python3-pil   # to test and to measure
  libboost-program-options-dev               # command line
  libboost-dev                               # the local server (Beast), checksums
  libcurl4-openssl-dev libssl-dev            # fetching a network, SHA-256
  nlohmann-json3-dev libzip-dev libutfcpp-dev
  libzstd-dev                                # splats in SPZ version 4
  libopenimageio-dev libjpeg62-turbo-dev libpng-dev libheif-dev liblcms2-dev   # pictures
  libopencv-dev                              # flow, networks of 2D methods
  libavformat-dev libavcodec-dev libavutil-dev libswscale-dev   # films, in and out
  libceres-dev libeigen3-dev
  colmap                                     # poses, started as a program
)
ask=
for word in "$@"; do
  [[ $word == --dev ]] && packages+=(clang-format clang-tidy)
  [[ $word == --dev || $word == --browser ]] && packages+=(chromium ffmpeg)
  [[ $word == --ask ]] && ask=1
done

if ! command -v dpkg-query >/dev/null; then
  echo "This is not a Debian system; install what corresponds to: ${packages[*]}" >&2
  exit 5
fi
missing=()
for package in "${packages[@]}"; do
  state=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ "$state" == installed ]] || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  echo "All packages are installed."
  exit 0
fi

as_root=()
if [[ $EUID -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "These packages are missing, and neither root nor sudo is at hand to install them:" >&2
    echo "  ${missing[*]}" >&2
    echo "Ask an administrator to run: apt-get install ${missing[*]}" >&2
    exit 5
  fi
  as_root=(sudo)
  # Where nobody can answer, a password prompt would wait for ever.
  [[ -t 0 && -z "${CI:-}" ]] || as_root=(sudo --non-interactive)
fi

echo "Installing: ${missing[*]}"
if [[ -n $ask && -t 0 ]]; then
  read -r -p "Install these Debian packages${as_root[*]:+ with sudo}? [y/N] " answer
  [[ $answer == [yY]* ]] || { echo "Nothing was installed." >&2; exit 5; }
fi
"${as_root[@]}" apt-get update -qq </dev/null
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends \
  "${missing[@]}" </dev/null
