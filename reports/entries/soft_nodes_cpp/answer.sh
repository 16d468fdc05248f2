#!/usr/bin/env bash
# Writes answers.csv of the questions in a folder: bash answer.sh QUESTIONS; needs twillight, slangc and g++.
set -euo pipefail
questions=$1
entry=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
for file in "$questions"/fabrics/*.toml; do
    twillight export "$file" --shader "$work/$(basename "$file" .toml)" --language cpp --level 2
done
source=$(ls "$work"/*/cpp/evaluate.cpp | head -n 1)
g++ -O2 -w -march=native -std=c++17 "$entry/entry.cpp" "$source" -o "$work/entry"
"$work/entry" "$questions" "$work" "$entry"
