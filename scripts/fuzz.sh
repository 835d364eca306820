#!/usr/bin/env bash
# Runs the fuzz targets one after another and prints a row of the table in docs/results.md for each.
#   scripts/fuzz.sh [RUNS] [TARGET...]      (10000000, all of them)
# Needs a nightly toolchain and cargo-fuzz: docs/fuzzing.md. Logs: fuzz/artifacts/TARGET.log; what crashed: fuzz/artifacts/TARGET/.
set -euo pipefail
cd "$(dirname "$0")/.."

runs=${1:-10000000}
targets=("${@:2}")
[ ${#targets[@]} -gt 0 ] || targets=($(cargo +nightly fuzz list))

# The code is safe Rust but for a few lines, so no sanitizer; debug assertions find numbers that overflow.
cargo +nightly fuzz build -O -s none
echo "| reader | executions | a second | crashes |"
echo "|---|---|---|---|"
for target in "${targets[@]}"; do
  log=fuzz/artifacts/$target.log
  mkdir -p "fuzz/corpus/$target" "fuzz/artifacts/$target"
  ok=0
  cargo +nightly fuzz run -O -s none "$target" "fuzz/corpus/$target" "fuzz/seeds/$target" -- \
    -runs="$runs" -timeout=5 -rss_limit_mb=2048 -max_len=4096 -print_final_stats=1 >"$log" 2>&1 || ok=1
  stat() { sed -n "s/^stat::$1: *//p" "$log" | tail -1; }
  echo "| $target | $(stat number_of_executed_units) | $(stat average_exec_per_sec) | $ok |"
done
