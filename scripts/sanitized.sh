#!/usr/bin/env bash
# Builds test programs with the address and undefined-behaviour sanitizers and runs them.
#
#   sanitized.sh PROGRAM...
#
# Not interactive. Exit status: 0 if everything passed.
set -euo pipefail
exec </dev/null

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
# Of the libraries only what these programs need.
cmake --preset sanitize -DREGRADE_WERROR=OFF -DREGRADE_BATCHES=ON -DREGRADE_ONLY_FOR="$(IFS=';' && echo "$*")"
cmake --build --preset sanitize --parallel "$(nproc)" --target "$@"
# GCC 13 and 14 misalign vectors of 64 bytes where stacks that functions have left are checked (GCC PR 110027).
export ASAN_OPTIONS=allocator_may_return_null=1:detect_stack_use_after_return=0 UBSAN_OPTIONS=print_stacktrace=1
export LSAN_OPTIONS=suppressions=$root/tests/support/leaks.supp,print_suppressions=0
# Threads that wait would take the cores of the test beside them.
export OMP_WAIT_POLICY=passive
ctest --test-dir build/sanitize --output-on-failure --no-tests=error -j2 -R "^($(IFS='|' && echo "$*"))(_[0-9]+)?\$"
