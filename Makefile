# Needs python3 (3.11 to 3.13) and make; everything else comes from requirements.lock into .venv.
VENV := .venv
PY := $(VENV)/bin/python
READY := $(VENV)/requirements.lock
export OPENBLAS_NUM_THREADS := 1
# Each process that a test starts would compile the project anew: a second or two.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo demo-data test test-slow lint docs lock screenshots stories recovery mutants clean

help:
	@echo "make demo      the whole way on data/demo: datasheets, checks, report, recordings"
	@echo "make test      the default tests"
	@echo "make test-slow all tests, the long sweeps as well"
	@echo "make lint      style, types, import direction"
	@echo "make docs      the documentation site in reports/site; any warning or broken link is an error"
	@echo "make demo-data simulate data/demo anew"
	@echo "make screenshots  docs/images from the demo's report and recordings (needs chromium, lavapipe)"
	@echo "make recovery  every estimator over 1,000 seeds; writes docs/recovery.md; goes on after a stop"
	@echo "make mutants   changes 40 places a package and runs their tests; writes docs/mutants.md; hours"
	@echo "make stories   figures of docs/real-recordings.md, from ../shared/data/real"
	@echo "make lock      resolve requirements.lock anew (needs uv)"
	@echo "make clean     remove .venv and caches"

# One motor of the demo has a poor joint: its check fails, and `run` says so by exit code 1. Another
# has a dry bearing, which its model verdict names. Anything else that is found, or not, is an error.
demo: $(READY)
	@$(PY) -m pipeline run input=data/demo output=reports/demo 'model.effects=[cogging]' || [ $$? -eq 1 ]
	@$(PY) -m tests.demo reports/demo

# A browser with an empty profile that asks nothing of the network.
SHOT := chromium --headless --no-sandbox --disable-gpu --no-first-run --hide-scrollbars \
  --disable-background-networking --disable-component-update --disable-sync

screenshots: demo
	@mkdir -p docs/images
	$(SHOT) --user-data-dir=$$(mktemp -d) --window-size=1200,1250 \
	  --screenshot=docs/images/report.png file://$(CURDIR)/reports/demo/report/G52-0601.html
	$(SHOT) --user-data-dir=$$(mktemp -d) --window-size=1500,1250 \
	  --screenshot=docs/images/fleet.png file://$(CURDIR)/reports/demo/report/index.html
	$(PY) -m tests.screenshots

demo-data: $(READY)
	rm -rf data/demo/*/
	$(PY) -m pipeline simulate output=data/demo fleet=demo

# Files in the order of their folders: by default the fullest come first, and a worker ends alone
# with one long test of a whole campaign.
SPREAD := -n logical --dist loadfile --no-loadscope-reorder

test: $(READY)
	$(PY) -m pytest $(SPREAD)

test-slow: $(READY)
	$(PY) -m pytest $(SPREAD) -m "slow or not slow"

stories: $(READY)
	$(PY) -m tests.stories.draw --into docs/images

recovery: $(READY)
	$(PY) -m tests.recovery.table --seeds 1000 --workers 2

mutants: $(READY)
	$(PY) -m tests.mutants.table --seed 1 --seed 2 --per-package 40

lint: $(READY)
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports

docs: $(READY)
	$(PY) -m tests.site reports/site

# The copy of the lock in .venv is the proof of what is installed: same content, nothing to do.
$(READY): requirements.lock
	@if cmp -s requirements.lock $@; then touch $@; else ./.ci/environment $(VENV); fi

lock:
	uv pip compile pyproject.toml --group dev --group docs --universal --python-version 3.11 \
	  --fork-strategy fewest --generate-hashes --no-annotate --no-header \
	  --output-file requirements.lock --quiet
	uv pip compile --group worlds --constraint requirements.lock --universal \
	  --python-version 3.11 --fork-strategy fewest --generate-hashes --no-annotate --no-header \
	  --output-file tests/benchmark/worlds/requirements.lock --quiet

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find pipeline tests -name __pycache__ -prune -exec rm -rf {} +
