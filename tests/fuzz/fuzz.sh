#!/usr/bin/env bash
# Fuzzes every reader with libFuzzer under the address and undefined-behaviour sanitizers, and prints a table.
#   fuzz.sh [SECONDS] [TARGET...]     30 s for each target by default; needs clang and libomp-dev
# Failing inputs are written to build/fuzz/finds, inputs that reached new code to build/fuzz/corpus. Limits are 5 s for an
# input and 512 MB for the process, sanitizers included. Exit status: 0, or 1 if there is a failing input.
set -euo pipefail
case "${1:-}" in
-h | --help)
  sed -n '2,5s/^# \{0,1\}//p' "$0"
  exit 0
  ;;
esac

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
cd "$root"
seconds=${1:-30}
shift || true
for program in clang++ cmake ninja; do
  command -v "$program" >/dev/null || { echo "fuzz.sh needs $program (apt-get install clang libomp-dev)" >&2; exit 5; }
done

launcher=()
if command -v ccache >/dev/null; then launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache); fi
cmake -S . -B build/fuzz -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_C_COMPILER=clang \
  -DCMAKE_CXX_COMPILER=clang++ -DREGRADE_FUZZ=ON -DREGRADE_CUDA=OFF -DREGRADE_BENCHMARKS=OFF "${launcher[@]}" >/dev/null
cmake --build build/fuzz --target fuzz_readers --parallel "${FUZZ_JOBS:-$(nproc)}" >build/fuzz/build.log 2>&1 ||
  { grep -E 'error|FAILED' build/fuzz/build.log >&2; echo "fuzz.sh: the build failed, see build/fuzz/build.log" >&2; exit 1; }

fuzzer=build/fuzz/tests/fuzz/fuzz_readers
finds=build/fuzz/finds
mkdir -p "$finds"
scratch=$(mktemp -d -p "$([[ -w /dev/shm ]] && echo /dev/shm || echo "${TMPDIR:-/tmp}")")
trap 'rm -rf "$scratch"' EXIT
export TMPDIR=$scratch
# A small quarantine: freed memory is reused early.
export ASAN_OPTIONS=quarantine_size_mb=8:allocator_may_return_null=1:detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1

mapfile -t targets < <("$fuzzer" --list)
if (($# > 0)); then targets=("$@"); fi
printf '%-20s %12s %8s %6s %8s %10s %9s\n' target executions crashes hangs memory "MB peak" edges
total=0
found=0
for target in "${targets[@]}"; do
  corpus=build/fuzz/corpus/$target
  mkdir -p "$corpus" "$scratch/seeds"
  "$fuzzer" --target="$target" --seeds="$corpus" >/dev/null
  for text in tests/fuzz/found/"$target"/*.hex; do
    [[ -e $text ]] && grep -v '^#' "$text" |
      python3 -c 'import sys; sys.stdout.buffer.write(bytes.fromhex(sys.stdin.read()))' >"$corpus/$(basename "$text" .hex)"
  done
  before=$(find "$finds" -type f | wc -l)
  "$fuzzer" --target="$target" "$corpus" -max_total_time="$seconds" -timeout=5 -rss_limit_mb=512 \
    -malloc_limit_mb=256 -max_len=65536 -print_final_stats=1 -artifact_prefix="$finds/$target-" \
    >"$scratch/log" 2>&1 </dev/null || cp "$scratch/log" "$finds/$target.log"
  count() { find "$finds" -name "$target-$1-*" -newer "$scratch/seeds" -type f | wc -l; }
  executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$scratch/log")
  # A fuzzer that stopped at a failing input prints no statistics: its last progress line has the number.
  [[ -n $executions ]] || executions=$(sed -n 's/^#\([0-9]*\)\s.*/\1/p' "$scratch/log" | tail -1)
  peak=$(sed -n 's/^stat::peak_rss_mb: *//p' "$scratch/log")
  edges=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$scratch/log" | tail -1)
  printf '%-20s %12d %8d %6d %8d %10s %9s\n' "$target" "${executions:-0}" "$(count crash)" "$(count timeout)" \
    "$(count oom)" "${peak:--}" "${edges:--}"
  total=$((total + ${executions:-0}))
  found=$((found + $(find "$finds" -type f -not -name '*.log' | wc -l) - before))
  rmdir "$scratch/seeds"
  if [[ -z ${executions:-} ]]; then
    echo "$target did not run:" >&2
    tail -5 "$scratch/log" >&2
    found=$((found + 1))
  fi
done
echo "$total executions of ${#targets[@]} targets, $found failing inputs"
((found == 0))
