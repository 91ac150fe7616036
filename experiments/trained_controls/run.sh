#!/usr/bin/env bash
# What the second view is worth to the plane sweep that learns to do without: the left image in place of the right one,
# and the right image of another pair, in training and in validation. A whole schedule of 2,500 steps; one seed each.
set -euo pipefail
family=trained_controls steps=2500 interval=500
source "$(dirname "$0")/../recipe.sh"

try base
try left_twice control=left_twice
try right_shuffled control=right_shuffled
tabulate base left_twice right_shuffled
