#!/usr/bin/env bash
# Runs the tests of a card, and regrade, on a machine that has nothing but a CUDA driver.
#
#   gpu_check.sh bundle DIR   on the build machine: writes to DIR regrade and the tests, built for sm_90 or for
#                             REGRADE_CUDA_ARCH, and their libraries
#   gpu_check.sh run DIR      there: runs the tests, under compute-sanitizer, too, where it is on the PATH; then
#                             `LD_LIBRARY_PATH=DIR/lib DIR/regrade` works on captures that have poses and points
#
# Exit status of run: 0, or 1 if a test fails or the sanitizer finds an error.
set -euo pipefail

usage() { sed -n '2,9p' "${BASH_SOURCE[0]}" | sed 's/^# \{0,1\}//'; }
[[ "${1:-}" != --help ]] || { usage; exit 0; }
[[ $# -eq 2 ]] || { usage >&2; exit 2; }
tests=(device_parity_test device_splat_fit_test device_splats_test device_style_test device_training_test)

bundle() {
  local root build
  root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
  build=$root/build/gpu-bundle
  cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DREGRADE_CUDA=ON \
    -DCMAKE_CUDA_ARCHITECTURES="${REGRADE_CUDA_ARCH:-90}" >/dev/null
  cmake --build "$build" --target regrade "${tests[@]}" --parallel "$(nproc)"
  mkdir -p "$1/lib"
  cp "$build/pipeline/regrade" "${tests[@]/#/$build/tests/gpu/}" "${BASH_SOURCE[0]}" "$1"
  strip "$1/regrade" "${tests[@]/#/$1/}"
  # All but glibc, which a driver's machine has.
  ldd "$1/regrade" "${tests[@]/#/$1/}" | awk '$3 ~ /^\// && $3 !~ /\/lib(c|m|dl|rt|pthread)\.so/ {print $3}' | sort -u |
    xargs -I{} cp -L {} "$1/lib"
  du -sh "$1"
}

run() {
  local status=0 test
  export LD_LIBRARY_PATH=$1/lib
  for test in "${tests[@]}"; do
    "$1/$test" --gtest_output="xml:$1/$test.xml" || status=1
    if command -v compute-sanitizer >/dev/null; then
      compute-sanitizer --error-exitcode 1 "$1/$test" --gtest_filter=-*Large* || status=1
    fi
  done
  return $status
}

dir=$(mkdir -p "$2" && cd "$2" && pwd)
case $1 in
  bundle) bundle "$dir" ;;
  run) run "$dir" ;;
  *) usage >&2; exit 2 ;;
esac
