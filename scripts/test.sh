#!/usr/bin/env bash
# Runs the tests: a build with warnings as errors, every test but those of scripts/nightly.sh, then kernels and readers
# again under the address and undefined-behaviour sanitizers. Not interactive. Exit status: 0 if everything passed.
set -euo pipefail
exec </dev/null

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
jobs=$(nproc)

# Test programs that read hostile input or do pointer arithmetic.
sanitized=(
  child_process_test kernels_bits_test kernels_color_test kernels_field_test kernels_network_test resize_test
  colmap_model_test pipeline_files_test pipeline_report_test readers_replay_test
  splat_files_test
)

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

echo "== build with sanitizers"
# Of the libraries only what these programs need.
cmake --preset sanitize -DREGRADE_WERROR=OFF -DREGRADE_BATCHES=ON -DREGRADE_ONLY_FOR="$(IFS=';' && echo "${sanitized[*]}")"
cmake --build --preset sanitize --parallel "$jobs" --target "${sanitized[@]}"

echo "== tests under sanitizers"
# GCC 13 and 14 misalign vectors of 64 bytes where stacks that functions have left are checked (GCC PR 110027).
export ASAN_OPTIONS=allocator_may_return_null=1:detect_stack_use_after_return=0 UBSAN_OPTIONS=print_stacktrace=1
export LSAN_OPTIONS=suppressions=$root/tests/support/leaks.supp,print_suppressions=0
ctest --test-dir build/sanitize --output-on-failure --no-tests=error -j2 -R "^($(IFS='|' && echo "${sanitized[*]}"))\$"
