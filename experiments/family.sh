# Functions for the run.sh of each family of runs; set `family`, the name of the folder, first and, to train, `interval`, the
# steps from one validation to the next.
cd "$(dirname "${BASH_SOURCE[0]}")/.."
here="experiments/$family" runs="outputs/$family"
export OMP_NUM_THREADS=1

# The real objects with their own colours, standing: some of the files have +Z up.
standing=(data=meshes data.root="${REAL:-}" data.table=experiments/real_objects/objects.csv texture=own)

fit() { # folder of the run, overrides
    local run=$1; shift
    .venv/bin/python -m stereo_occ.train experiment=recipe scale=laptop trainer.threads=1 validation.interval="$interval" \
        validation.views=4 validation.points=8192 progress=false hydra.run.dir="$run" "$@"
}

judge() { # folder of the evaluation, overrides; as all tables but where those say otherwise
    local evaluation=$1; shift
    .venv/bin/python -m stereo_occ.evaluate views=8 points=20000 meshes=1 mesh_resolution=64 surface_points=20000 \
        examples=0 trainer.threads=1 progress=false hydra.run.dir="$evaluation" "$@"
}

nameless() { # JSON files, in which the folder of real objects becomes REAL
    if [ -n "${REAL:-}" ]; then sed -i "s|$REAL|REAL|" "$@"; fi
}

keep() { # folder of an evaluation, name of its files beside run.sh
    mkdir -p "$(dirname "$here/$2")"
    cp "$1/metrics.json" "$here/$2.json"
    cp "$1/per_object.csv" "$here/$2_per_object.csv"
    nameless "$here/$2.json"
}

collect() { # folder of a run with its evaluations, folder for what is kept of it
    .venv/bin/python -m experiments.collect "$1" "$2"
    nameless "$2"/*.json
}

# Train with the recipe, measure on test objects and, where REAL names a folder of them, on real ones; keep the results.
learn() { # name, steps, overrides
    local name=$1 run="$runs/$1" steps=$2; shift 2
    fit "$run" steps="$steps" "$@"
    judge "$run/test_best" checkpoint="$run/best.ckpt" examples=3
    if [ -n "${REAL:-}" ]; then
        judge "$run/real_best" checkpoint="$run/best.ckpt" examples=3 data=meshes data.root="$REAL" data.views=16
    fi
    collect "$run" "$here/$name"
}

differ() { # folder, A, B: what A has over B; folders of their evaluations
    .venv/bin/python -m stereo_occ.compare "$2" "$3" --output "$here/$1"
}

against() { # folder, A, B: what A has over B; family/name of each; real if on real objects
    local where=${4:-test}
    differ "$1" "outputs/$2/${where}_best" "outputs/$3/${where}_best"
}

# What one change does to the plane sweep, on a schedule of `steps`; set it first.
try() { # name, overrides
    local name=$1; shift
    fit "$runs/$name" model=plane_sweep_stereo steps="$steps" "$@"
}

tabulate() { # names, first that of the run from which the others differ
    .venv/bin/python -m experiments.changes "$here/$family.csv" "${@/#/$runs/}"
}
