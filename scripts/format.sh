#!/usr/bin/env bash
# Formats the sources with clang-format; with --check it changes nothing and fails if a file is not formatted.
set -euo pipefail

cd "$(dirname "${BASH_SOURCE[0]}")/.."
mode=(-i)
if [[ "${1:-}" == "--check" ]]; then
  mode=(--dry-run --Werror)
fi
git ls-files -z -- '*.h' '*.cc' '*.cu' | xargs -0 clang-format "${mode[@]}"
