# make demo: run the six oblique impacts of the paper's Table 1; make test; make lint;
# make docs; make clean.
# PYTHON=python3.12 chooses another interpreter (3.11 or later), VENV=... another place.
PYTHON ?= python3
VENV ?= .venv

# What make starts uses the wheels in $(VENV), also in a shell where a system ROS is sourced.
unexport PYTHONPATH PYTHONHOME AMENT_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH
unexport RMW_IMPLEMENTATION

BIN := $(VENV)/bin
# Two test processes per core: those of the nodes wait for other processes most of the time.
WORKERS := $(shell echo $$((2 * $$(nproc))))
# First falls and impacts, whose machine code is compiled side by side, and what needs none; then
# nodes and those with the longest tests, so that no core waits for the others at the end.
FIRST := test/test_falls.py test/test_study_certify.py $(sort $(wildcard test/test_biomech_*.py)) \
  test/test_helmet_bad_meshes.py test/test_nodes_trust.py test/test_explore_page.py \
  $(sort $(wildcard test/test_study_*.py test/test_nodes_*.py)) test/test_colcon.py \
  test/test_report_page.py
TESTS := $(FIRST) $(filter-out $(FIRST),$(sort $(wildcard test/test_*.py)))
PACKAGING := setup.py setup.cfg pyproject.toml package.xml $(wildcard scripts/*_node)
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check

.PHONY: demo test lint docs clean

demo: $(VENV)/.demo-ready
	@$(BIN)/helmet-sim run oblique_table1

test: $(VENV)/.test-ready
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder $(TESTS)

lint: $(VENV)/.test-ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(VENV)/.docs-ready
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "build/site/index.html; with search: $(BIN)/python -m http.server --directory build/site"

clean:
	rm -rf $(VENV) build install log *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "helmet_sim_ros needs Python 3.11 or later; choose one: make PYTHON=python3.11" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "$(PYTHON) cannot make virtual environments; on Debian and Ubuntu:" \
	    "sudo apt install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

# A stamp per set of extras: the next call starts at once, a changed setup.py installs again.
$(VENV)/.demo-ready: $(PACKAGING) | $(BIN)/python
	@echo "Installing into $(VENV), once; this takes a minute or two"
	$(PIP) --editable '.[ros]'
	@touch $@

$(VENV)/.test-ready: $(VENV)/.demo-ready
	@echo "Installing the tools of the tests into $(VENV), once"
	$(PIP) --editable '.[ros,report,test]'
	@touch $@

$(VENV)/.docs-ready: $(VENV)/.demo-ready
	@echo "Installing the tools of the documentation into $(VENV), once"
	$(PIP) --editable '.[ros,docs]'
	@touch $@
