#!/usr/bin/env bash
# Runs the tests: a build with warnings as errors, every test but those of scripts/nightly.sh, then what reads files again
# under the address and undefined-behaviour sanitizers. Not interactive. Exit status: 0 if everything passed.
set -euo pipefail
exec </dev/null

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
jobs=$(nproc)

scripts/install_packages.sh --browser
# The tests of pages fail without Chromium, instead of being skipped.
export REGRADE_REQUIRE_BROWSER=1

echo "== build, warnings are errors"
cmake --preset cpu -DREGRADE_WERROR=ON -DREGRADE_BATCHES=ON
cmake --build --preset cpu --parallel "$jobs"

echo "== tests"
# Threads that wait would take the cores of the test beside them.
export OMP_WAIT_POLICY=passive
if ! ctest --test-dir build/cpu --output-on-failure -j2 -LE nightly; then
  echo "== what failed, once more"
  grep -A12 ': Failure$' build/cpu/Testing/Temporary/LastTest.log | tail -n 100
  exit 1
fi

echo "== sanitizers"
# Programs that read hostile input; scripts/nightly.sh has more.
scripts/sanitized.sh kernels_bits_test colmap_model_test readers_replay_test splat_files_test
