#!/usr/bin/env bash
# The weights for photographs before path-traced pairs of the real objects (REAL: their folder), and before the same objects,
# poses and cameras in the project's own pictures. Needs Mitsuba (pip install 'stereo-occ[path-traced]') and LLVM, whose
# library DRJIT_LIBLLVM_PATH names where it is not found. Rendering resumes; a pair takes 10 seconds of one core.
# CHECKPOINT and RESULTS: other weights, and the folder for what they reach.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
export OMP_NUM_THREADS=1
checkpoint=${CHECKPOINT:-field} results=${RESULTS:-experiments/path_traced}

.venv/bin/python -m experiments.path_traced.render --root "$REAL"
.venv/bin/python -m experiments.path_traced.own_shader --root "$REAL"
.venv/bin/python -m experiments.path_traced.measure --root "$REAL" --checkpoint "$checkpoint" --output "$results"
.venv/bin/python -m experiments.path_traced.measure --root "$REAL" --checkpoint "$checkpoint" \
    --pairs outputs/path_traced_own_shader --output "$results/own_shader"
