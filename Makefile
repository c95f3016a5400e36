# Two commands do everything: make demo, make test. `make` alone lists the targets.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup ros demo test soak lint format clean

PYTHON ?= $(firstword $(foreach name,python3.11 python3.10 python3 python,$(shell \
	$(name) -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 10), (3, 11)))' >/dev/null 2>&1 && echo $(name))))
VENV := .venv
BIN := $(VENV)/bin
DEMO := runs/demo
INPUTS := pyproject.toml constraints.txt hatch_build.py $(wildcard drs_core/accelerator/*.[ch])
# The wheels of ROS 2 are for Python 3.11; with 3.10 everything but the ROS 2 graph works.
ROS_WS := ros_ws
ROS_STAMP := $(if $(shell $(if $(PYTHON),$(PYTHON),false) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' \
	>/dev/null 2>&1 && echo yes),$(ROS_WS)/install/nodes-built)
COLCON = cd $(ROS_WS) && COLCON_LOG_LEVEL=error PATH="$(abspath $(BIN)):$$PATH" AMENT_PREFIX_PATH="$(abspath $(VENV))" \
	CMAKE_PREFIX_PATH="$(abspath $(VENV))" "$(abspath $(BIN))/colcon" --log-base log build \
	--event-handlers console_start_end- console_stderr- parallel_status- summary-
SOURCED = set +u; $(if $(ROS_STAMP),source $(ROS_WS)/install/setup.bash;)
export PIP_DISABLE_PIP_VERSION_CHECK := 1

help:  ## list the targets
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## (.*)/  make \1\t\2/' | expand -t 16

setup: $(VENV)/tests-installed  ## set up everything in .venv

ros: $(VENV)/demo-installed  ## build the ROS 2 graph with wheels of ROS 2 Jazzy (Python 3.11)
	@test -n "$(ROS_STAMP)" || { echo "The wheels of ROS 2 Jazzy are for Python 3.11;" \
		"name one: make clean && make PYTHON=/path/to/python3.11 ros" >&2; exit 1; }
	@$(MAKE) --no-print-directory $(ROS_STAMP)

demo: $(VENV)/demo-installed $(ROS_STAMP)  ## tune the shipped Panda agent over the ROS 2 graph, show before and after in a report
	@rm -rf $(DEMO)
ifneq ($(ROS_STAMP),)
	@echo "== Tuning panda_reach for smooth motion: two simulator nodes, tuner, policy; 640 rollouts in 20 updates"
	$(BIN)/drs graph params/panda_reach.yaml --tune --output $(DEMO)
else
	@echo "== Tuning panda_reach for smooth motion: 16 directions, 20 updates, 640 rollouts"
	$(BIN)/drs tune panda_reach --params params/panda_reach.yaml --output $(DEMO) --workers 2
endif
	@echo "== Comparing before and after on 100 fresh episodes"
	$(BIN)/drs compare panda_reach $(DEMO)/agent.safetensors --workers 2 --figure $(DEMO)/tip_motion.png
	@echo "== Writing the report, with a film of before and after"
	$(BIN)/drs report $(DEMO) --workers 2

test: $(VENV)/tests-installed $(ROS_STAMP)  ## run all tests (18 minutes on two cores)
	@echo "== Running the tests of the library, two at a time"
	@$(SOURCED) $(BIN)/python -m pytest -m "not nodes and not alone and not soak" --numprocesses 2 --dist loadfile
	@echo "== Running those of nodes that wait for each other, two at a time"
	@$(SOURCED) $(BIN)/python -m pytest -m "nodes and not soak" --numprocesses 2 --dist loadfile
	@echo "== Running the tests that judge time, and those of nodes that run in real time"
	@$(SOURCED) $(BIN)/python -m pytest -m "alone and not soak"

soak: $(VENV)/tests-installed $(ROS_STAMP)  ## run the long tests: three hours and more
	@$(SOURCED) $(BIN)/python -m pytest -m soak --timeout 14400 --capture no

lint: $(VENV)/tests-installed  ## check style, types, the walls between modules, and for unsafe calls
	@echo "== Checking style, types, walls and unsafe calls"
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/bandit --quiet --recursive -ll drs_core ros_ws/src

format: $(VENV)/tests-installed  ## format the code
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean:  ## remove the set-up and the demo's results
	rm -rf $(VENV) $(DEMO) $(ROS_WS)/build $(ROS_WS)/install $(ROS_WS)/log

$(VENV)/created:
	@test -n "$(PYTHON)" || { echo "drs needs Python 3.10 or 3.11 and found neither; install python3.11," \
		"or name one: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 10), (3, 11)))' 2>/dev/null || { \
		echo "$(PYTHON) is not Python 3.10 or 3.11, which PyBullet's wheels need; install python3.11," \
		"or name one: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@echo "== Making $(VENV) with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv $(VENV) || { echo "$(PYTHON) has no venv module; install it (Debian, Ubuntu: python3-venv)." >&2; \
		rm -rf $(VENV); exit 1; }
	@touch $@

$(VENV)/demo-installed: $(VENV)/created $(INPUTS)
	@echo "== Installing the simulator and the report tools"
	$(BIN)/pip install --quiet --quiet -c constraints.txt -e '.[sim,report]'
	@touch $@

$(VENV)/tests-installed: $(VENV)/created $(INPUTS)
	@echo "== Installing everything that the tests need (PyTorch included)"
	$(BIN)/pip install --quiet --quiet -c constraints.txt -e '.[sim,report,serve,record,ray,train,dev]'
	@touch $@ $(VENV)/demo-installed

$(VENV)/ros-installed: constraints-ros.txt | $(VENV)/demo-installed
	@echo "== Installing ROS 2 Jazzy"
	$(BIN)/pip install --quiet --quiet -c constraints.txt -r constraints-ros.txt
	@touch $@

$(ROS_WS)/install/interfaces-built: $(VENV)/ros-installed $(shell find $(ROS_WS)/src/drs_interfaces $(ROS_WS)/cmake -type f)
	@echo "== Building the ROS 2 messages (about a minute)"
	@$(COLCON) --packages-select drs_interfaces --cmake-args -G Ninja -DBUILD_TESTING=OFF \
		-DPython3_EXECUTABLE="$(abspath $(BIN))/python" \
		-DCMAKE_PROJECT_INCLUDE="$(abspath $(ROS_WS))/cmake/drop_missing_include_folders.cmake" || { \
		cat log/latest_build/drs_interfaces/stdout_stderr.log >&2; exit 1; }
	@touch $@

$(ROS_WS)/install/nodes-built: $(ROS_WS)/install/interfaces-built $(shell find $(ROS_WS)/src/drs -type f -not -path '*/__pycache__/*')
	@echo "== Building the ROS 2 nodes"
	@$(COLCON) --packages-select drs || { cat log/latest_build/drs/stdout_stderr.log >&2; exit 1; }
	@touch $@
