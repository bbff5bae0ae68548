#!/usr/bin/env bash
# The long forms of the tests, some hours on two cores, in the build that scripts/test.sh made. Not interactive. Exit
# status: 0 if everything passed.
set -uo pipefail
exec </dev/null

cd "$(dirname "${BASH_SOURCE[0]}")/.."
export OMP_WAIT_POLICY=passive REGRADE_REQUIRE_BROWSER=1
# Tests that are skipped else, pairs that attack the bound of a network, mutants for each reader.
export REGRADE_NIGHTLY=1 REGRADE_PAIRS=1000000 REGRADE_FUZZ_MUTANTS=1000000
program=build/cpu/pipeline/regrade
failed=0
run() { echo "== $*"; "$@" || [[ $? == 77 ]] || failed=1; }  # 77: skipped

run ctest --test-dir build/cpu --output-on-failure -j2 --timeout 36000
run tests/scripts/slurm_loopback.sh $program
run python3 tests/scripts/crash_recovery.py $program --kills 200 --part-kills 20 --block-kills 20 --pose-kills 10
run python3 tests/scripts/write_fault_injection.py $program build/cpu/tests/pipeline/libfailing_writes.so
run python3 tests/scripts/resource_limits.py $program
run scripts/sanitized.sh child_process_test kernels_color_test kernels_field_test kernels_network_test resize_test \
  pipeline_files_test pipeline_report_test
exit $failed
