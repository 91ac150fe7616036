# Every target that needs the environment builds it first; `make help` lists them.
PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin
READY := $(VENV)/.ready
DEMO := outputs/demo

.DEFAULT_GOAL := help
.PHONY: help setup demo test lint types check tensorboard results contact-sheets figures lock clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(READY) ## virtual environment .venv with the locked packages and this one, editable

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "stereo_occ: $$($(PYTHON) --version) is too old, need 3.11 or later; set PYTHON=python3.x" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(RUN)/pip install --quiet --no-deps --require-hashes -r requirements.lock
	$(RUN)/pip install --quiet --no-deps --no-build-isolation -e .
	@touch $@

demo: $(READY) ## a mesh from the example pair with shipped weights; then render, train and evaluate a small model (minutes)
	@$(RUN)/python -m stereo_occ.reconstruct left=examples/left.png right=examples/right.png rig=examples/calibration.yaml output=$(DEMO)/mug.glb
	@$(RUN)/python -m stereo_occ.train scale=smoke queries=mixed hydra.run.dir=$(DEMO)/train resume=never
	@$(RUN)/python -m stereo_occ.evaluate checkpoint=$(DEMO)/train/best.ckpt points=20000 views=4 hydra.run.dir=$(DEMO)/evaluation
	@echo
	@echo "the example pair as a mesh:                 $(DEMO)/mug.glb, its outline: $(DEMO)/mug_preview.png"
	@echo "pictures (left | right | predicted | true): $(DEMO)/evaluation/pictures"
	@echo "meshes (GLB):                               $(DEMO)/evaluation/meshes"
	@echo "metrics:                                    $(DEMO)/evaluation/metrics.json"
	@echo "curves:                                     make tensorboard"

test: $(READY) ## run the tests, a process per core
	OMP_NUM_THREADS=1 $(RUN)/python -m pytest -n auto --dist loadfile

lint: $(READY) ## ruff: rules and format
	$(RUN)/ruff check .
	$(RUN)/ruff format --check .

types: $(READY) ## mypy, strict
	$(RUN)/mypy

check: lint types test ## all that must pass before a change goes in

tensorboard: $(READY) ## open the dashboards of every run under outputs/
	$(RUN)/tensorboard --logdir outputs

results: $(READY) ## the README's table and figures from the files under experiments/
	$(RUN)/python -m experiments.results

contact-sheets: $(READY) ## one picture per group of variations, in experiments/variation
	$(RUN)/python -m experiments.variation.contact_sheets

figures: $(READY) ## the contact sheet of procedural objects, the drawings of the rigs
	$(RUN)/python -m experiments.objects.contact_sheet
	$(RUN)/python -m experiments.rig.draw

lock: ## renew requirements.lock from pyproject.toml (needs uv)
	uv pip compile pyproject.toml --extra dev --universal --python-version 3.11 --generate-hashes \
		--no-annotate --no-emit-index-url --no-header -o requirements.lock

clean: ## remove the environment and caches, keep outputs/
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache
