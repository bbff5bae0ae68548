#!/usr/bin/env bash
# Checks and measures the GPU parts of regrade.
#
#   gpu_check.sh bundle DIR [FILE.npz...]   on the build machine: writes to DIR the programs (for sm_90, or for
#                                           REGRADE_CUDA_ARCH), their libraries beyond glibc, and packed captures
#   gpu_check.sh run DIR [OUT]              on the machine with the GPU, which needs a CUDA driver; with
#                                           compute-sanitizer on its PATH, small scenes run under its four tools;
#                                           with ncu, the kernels of one small fit, restyling and frame are measured
#   gpu_check.sh repeat DIR CAPTURE [OUT]   there, too: fits and restyles a capture that was packed with a style three
#                                           times with --reproducible and three times without; prints seconds and the
#                                           hashes of field, network, styled field and frames
#
# `run` prints the parity table, fits each packed capture (with REGRADE_FIT, default: --preset best), restyles the
# field with each recipe if the capture was packed with a style, and writes OUT/gpu_check.json (default for OUT: DIR).
# REGRADE_RECIPES="standard" leaves out the paper's recipes.
# Exit status: 0, or 1 if a tolerance is exceeded, a sanitizer finds an error or reproducible results differ.
set -euo pipefail
exec </dev/null

usage() { sed -n '2,16s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"; }
[[ "${1:-}" != --help ]] || { usage; exit 0; }
[[ $# -ge 2 ]] || { usage >&2; exit 2; }
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
mkdir -p "$2"
dir=$(cd "$2" && pwd)

bundle() {
  local build=$root/build/gpu-bundle
  cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DREGRADE_CUDA=ON -DREGRADE_BENCHMARKS=OFF \
    -DCMAKE_CUDA_ARCHITECTURES="${REGRADE_CUDA_ARCH:-90}" >/dev/null
  cmake --build "$build" --target regrade_gpu device_{film,parity,splat_fit,splats,style,training}_test --parallel "$(nproc)"
  cp "$build/pipeline/regrade_gpu" "$build"/tests/gpu/device_{film,parity,splat_fit,splats,style,training}_test "${BASH_SOURCE[0]}" "$dir"
  strip "$dir/regrade_gpu" "$dir"/device_{film,parity,splat_fit,splats,style,training}_test
  ldd "$dir/regrade_gpu" | awk '/lib(zip|boost|bz2|crypto|gomp|z)[._]/ {print $3}' | xargs -I{} cp -L {} "$dir"
  [[ $# -eq 0 ]] || cp "$@" "$dir"
  du -sh "$dir"
}

# Time, bytes of memory and of the L2 cache, warp instructions and tensor-core instructions of each kernel, in a small
# fit of a capture packed with a style.
measure_kernels() {
  local capture=$1 field=$2/kernels_field.npz
  local metrics=gpu__time_duration.sum,dram__bytes.sum,lts__t_bytes.sum,smsp__inst_executed.sum
  metrics+=,sm__inst_executed_pipe_tensor.sum,sm__warps_active.avg.pct_of_peak_sustained_active
  local fit="fit --capture $capture --fit-resolutions 128,256 --fit-rays 16384 --fit-steps"
  local profile="ncu --clock-control none --csv --metrics $metrics"
  # shellcheck disable=SC2086  # words
  "$dir/regrade_gpu" $fit 600,600 --out "$field" >/dev/null 2>&1 || return 1
  # The last steps of the finer grid, each kernel once.
  # shellcheck disable=SC2086
  $profile -k 'regex:FitRays|StepKernel|TotalVariation|DrawKernel' --launch-skip 2000 --launch-count 4 \
    "$dir/regrade_gpu" $fit 600,600 | grep '^"'
  # shellcheck disable=SC2086
  # Each kernel of a style step; the network's adjoint runs once for 65536 voxels.
  $profile -k 'regex:MarchWeights|GatherRows|AddMapped|ForwardKernel|AdjointRows|OuterProducts|Blend|ColorLoss|AssignSlots|ActivateWeights|GradientKernel|UpdateKernel' \
    --launch-skip 300 --launch-count 40 \
    "$dir/regrade_gpu" style --capture "$capture" --field "$field" --style-steps 30 | grep '^"'
  # shellcheck disable=SC2086
  $profile -k 'regex:RenderRays' --launch-skip 20 --launch-count 1 \
    "$dir/regrade_gpu" render --capture "$capture" --field "$field" | grep '^"'
  rm -f "$field"
}

run() {
  local out=${1:-$dir} status=0 name
  mkdir -p "$out"
  export LD_LIBRARY_PATH=$dir${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
  : >"$out/parity.txt"
  for test in device_{film,parity,splat_fit,splats,style,training}_test; do
    # `hard_cases.py OUT/*.xml` prints these numbers.
    "$dir/$test" --gtest_output="xml:$out/$test.xml" >>"$out/parity.txt" || status=1
  done
  grep -E '^parity|PASSED|FAILED|SKIPPED' "$out/parity.txt"
  echo '{' >"$out/gpu_check.json"
  printf '"device": %s,\n"parity_passed": %s' "$("$dir/regrade_gpu" device)" \
    "$([[ $status == 0 ]] && echo true || echo false)" >>"$out/gpu_check.json"
  if command -v compute-sanitizer >/dev/null; then
    for tool in memcheck racecheck initcheck synccheck; do
      local clean=true
      : >"$out/$tool.txt"
      for test in "device_parity_test --gtest_filter=*basis9*" "device_style_test --gtest_filter=-*Large*" \
        device_training_test; do
        # shellcheck disable=SC2086  # a program and its option
        compute-sanitizer --tool "$tool" --error-exitcode 9 "$dir"/$test >>"$out/$tool.txt" 2>&1 ||
          { clean=false; status=1; }
      done
      printf ',\n"%s_clean": %s' "$tool" "$clean" >>"$out/gpu_check.json"
      echo "$tool: $(tail -1 "$out/$tool.txt")"
    done
  fi
  if command -v ncu >/dev/null; then
    for capture in "$dir"/*.npz; do
      [[ ! -e $capture ]] || measure_kernels "$capture" "$out" >"$out/kernels.txt" 2>&1 || status=1
      break
    done
  fi
  for capture in "$dir"/*.npz; do
    [[ -e $capture ]] || continue
    name=$(basename "$capture" .npz)
    # shellcheck disable=SC2086  # settings are words
    if record=$("$dir/regrade_gpu" fit --capture "$capture" --out "$out/field.npz" ${REGRADE_FIT:---preset best} \
      2>/dev/null); then
      printf ',\n"fit_%s": %s' "$name" "$record" >>"$out/gpu_check.json"
      echo "$name: $record" | cut -c1-400
    else
      status=1
      echo "$name: the fit failed"
      continue
    fi
    for recipe in ${REGRADE_RECIPES:-standard paper every-voxel}; do  # every-voxel: ten steps of all voxels
      local options="--recipe $recipe"
      [[ $recipe == every-voxel ]] && options="--recipe paper --style-every-voxel --style-steps 10"
      # shellcheck disable=SC2086  # options are words
      if record=$("$dir/regrade_gpu" style --capture "$capture" --field "$out/field.npz" $options 2>"$out/style.txt"); then
        printf ',\n"style_%s_%s": %s' "$name" "$recipe" "$record" >>"$out/gpu_check.json"
        echo "$name, $recipe: $record" | cut -c1-400
      else
        grep -q "holds no style picture" "$out/style.txt" && break
        status=1
        echo "$name: style training failed ($recipe)"; cat "$out/style.txt"
      fi
    done
    rm -f "$out/field.npz"
  done
  printf '\n}\n' >>"$out/gpu_check.json"
  return $status
}

# REGRADE_FIT: options of the fit; REGRADE_STYLE: of the training.
repeat() {
  local capture=$1 out=${2:-$dir} option turn of hashes first record status=0
  local fit=${REGRADE_FIT:---preset standard}
  mkdir -p "$out"
  export LD_LIBRARY_PATH=$dir${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
  for option in --reproducible --no-reproducible; do
    first=
    for turn in 1 2 3; do
      rm -rf "$out"/{field,network,styled}.npz "$out/frames"
      # shellcheck disable=SC2086  # options are words
      record=$("$dir/regrade_gpu" fit --capture "$capture" --out "$out/field.npz" $option $fit 2>/dev/null &&
        "$dir/regrade_gpu" style --capture "$capture" --field "$out/field.npz" --network "$out/network.npz" $option \
          --styled "$out/styled.npz" --frames "$out/frames" ${REGRADE_STYLE:-} 2>/dev/null) ||
        { echo "$option $turn failed"; return 1; }
      hashes="$(cat "$out"/frames/* | sha256sum | cut -c1-12) of frames,"
      for of in field network styled; do hashes+=" $(sha256sum <"$out/$of.npz" | cut -c1-12) of $of"; done
      echo "$option $turn: $hashes;" \
        "$(grep -oE '"(seconds_fit|seconds_learn|psnr_heldout_db|psnr_to_2d_db|voxels)": ?[0-9.]+' <<<"$record" | tr '\n' ' ')"
      [[ $option != --reproducible || ${first:=$hashes} == "$hashes" ]] || status=1
    done
  done
  rm -rf "$out"/{field,network,styled}.npz "$out/frames"
  return $status
}

case $1 in
  repeat) shift 2; repeat "$@" ;;
  bundle) shift 2; bundle "$@" ;;
  run) shift 2; run "$@" ;;
  *) usage >&2; exit 2 ;;
esac
