# The commands the README names; each works from a fresh clone on its own.
VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= python3
OUT ?= out
# Keep DDS traffic on this machine; export another value to talk to other hosts.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV):$(AMENT_PREFIX_PATH)

.PHONY: setup demo test lint bench clean
setup: $(VENV)/.installed

$(VENV)/.installed: constraints.txt src/teleop_core/setup.py
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e 'src/teleop_core[ros,test]'
	touch $@

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test: lint
	$(BIN)/pytest

clean:
	rm -rf $(OUT) ros_ws/build ros_ws/install ros_ws/log
