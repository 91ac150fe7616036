# Functions for the run.sh of each family of runs; set `family`, the name of the folder, first.
cd "$(dirname "${BASH_SOURCE[0]}")/.."
here="experiments/$family" runs="outputs/$family"
export OMP_NUM_THREADS=1

measure() { # name, where, overrides
    local name=$1 where=$2; shift 2
    .venv/bin/python -m stereo_occ.evaluate checkpoint="$runs/$name/best.ckpt" views=8 points=20000 meshes=1 \
        mesh_resolution=64 surface_points=20000 examples=3 trainer.threads=1 progress=false \
        hydra.run.dir="$runs/$name/${where}_best" "$@"
}

# Train with the recipe, measure on test objects and, where REAL names a folder of them, on real ones; keep the results.
learn() { # name, steps, overrides
    local name=$1 steps=$2; shift 2
    .venv/bin/python -m stereo_occ.train experiment=recipe scale=laptop steps="$steps" trainer.threads=1 \
        validation.interval=1000 validation.views=4 validation.points=8192 progress=false \
        hydra.run.dir="$runs/$name" "$@"
    measure "$name" test
    if [ -n "${REAL:-}" ]; then
        measure "$name" real data=meshes data.root="$REAL" data.views=16
    fi
    .venv/bin/python experiments/collect.py "$runs/$name" "$here/$name"
    if [ -n "${REAL:-}" ]; then
        sed -i "s|$REAL|REAL|" "$here/$name/real.json"
    fi
}

against() { # folder, A, B: what A has over B; family/name of each; real if on real objects
    local where=${4:-test}
    .venv/bin/python -m stereo_occ.compare "outputs/$2/${where}_best" "outputs/$3/${where}_best" --output "$here/$1"
}

# What one change does to the plane sweep, on a schedule of `steps` that is validated every `interval`; set both first.
try() { # name, overrides
    local name=$1; shift
    .venv/bin/python -m stereo_occ.train experiment=recipe scale=laptop model=plane_sweep_stereo steps="$steps" \
        validation.interval="$interval" validation.views=4 validation.points=8192 trainer.threads=1 progress=false \
        hydra.run.dir="$runs/$name" "$@"
}

tabulate() { # names, first that of the run from which the others differ
    .venv/bin/python experiments/changes.py "$here/$family.csv" "${@/#/$runs/}"
}
