# Every target sets up the virtual environment first; that is quick when nothing changed.
#   make demo      make demo ARGS="--seed 1"      make test PYTHON=python3.13      make test TESTS=tests/skill
PYTHON ?= python3
INTERPRETER := $(shell .ci/find-python "$(PYTHON)")
ifeq ($(INTERPRETER),)
$(error PYTHON=$(PYTHON) does not run here)
endif
VERSION := $(shell "$(INTERPRETER)" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
# The default interpreter uses .venv; a chosen one gets an environment of its own.
VENV ?= .venv$(if $(filter python3,$(PYTHON)),,-$(VERSION))
RUN := "$(VENV)/bin/python" -m
PYTEST := $(RUN) pytest -n 2 --dist worksteal
# One thread per process: the small matrices of the learner are slower with more.
export OPENBLAS_NUM_THREADS := 1
# The tested versions of all packages; another Python takes the newest that pyproject.toml allows.
CONSTRAINTS := $(wildcard constraints/$(VERSION).txt)
FAST := not slow and not browser and not nightly
# Types are checked with one set of stubs: those of NumPy 2.5, for newer Pythons, report errors in correct calls.
MYPY := $(if $(filter 3.11,$(VERSION)),$(RUN) mypy,@echo "types: checked with Python 3.11 only")

.PHONY: demo test test-fast test-nightly lint mutants fuzz campaign bench sweeps docs release clean environment .venv system-packages

demo: environment
	$(RUN) haptic_skill demo $(ARGS)

# Lint and types beside all tests but the nightly ones: about eight minutes on two cores.
test: environment system-packages
	@mkdir -p out
	@$(MAKE) --no-print-directory lint > out/lint.log 2>&1 & \
	$(PYTEST) -m "not nightly" $(TESTS); result=$$?; \
	wait $$! && exit $$result || { cat out/lint.log; exit 1; }

# For daily work: neither lint, nor pages, nor what takes over half a second.
test-fast: environment
	$(PYTEST) -m "$(FAST)" $(TESTS)

# What takes minutes or checks what changes rarely: damaged files, killed commands, mutants, wheel, site, whole sweeps,
# every command of README, and each tutorial.
test-nightly: environment system-packages fuzz campaign mutants
	$(PYTEST) --hypothesis-profile nightly -m "nightly or hypothesis"

lint: environment
	$(RUN) ruff check .
	$(RUN) ruff format --check .
	$(RUN) codespell_lib
	$(MYPY)

# 100 small faults, one at a time: how many does a test of `make test` notice?
mutants: environment
	$(RUN) tests.mutants --jobs 2 --json out/mutants.json

# 200 SIGKILLs at random moments of four commands: is anything lost? About eight minutes.
campaign: environment
	$(RUN) tests.campaign --jobs 2 --json out/campaign.json

# 10,000 damaged recordings, runs, skills and scenarios: does one load unnoticed? Two minutes.
fuzz: environment
	$(RUN) tests.fuzz --jobs 2 --json out/fuzz.json

PHYSICS := theory mujoco_probe

# Contact in Drake against theory, and the same peg in MuJoCo.
bench: environment
	$(RUN) pip install --quiet --editable ".[peers]" $(CONSTRAINTS:%=--constraint %)
	for name in $(PHYSICS); do $(RUN) benchmarks.physics.$$name --json out/benchmarks/$$name.json || exit 1; done

CURVES := demonstrations friction sensor_noise pivot mount_stiffness

# The curves of docs/curves and of docs/learning. What is there is kept: an interrupted sweep continues where it stopped.
sweeps: environment
	for name in $(CURVES); do \
	  "$(VENV)/bin/haptic-skill" sweep benchmarks/sweeps/$$name.yaml --out out/sweeps/curves || exit 1; \
	done

RELEASE := out/release/files
NAME = haptic-skill-$(shell "$(VENV)/bin/python" -c 'from importlib.metadata import version; print(version("haptic-skill"))')

# Wheel and sources with the skill of the checkout, the skill and demonstrations of a new demo, paper, site, checksums.
release: environment docs
	rm -rf out/release && mkdir -p $(RELEASE)
	"$(VENV)/bin/haptic-skill" demo --out out/release/demo
	$(RUN) pip install --quiet build pypandoc_binary typst
	$(RUN) build --outdir $(RELEASE) . > out/release/build.log 2>&1 || { tail out/release/build.log; exit 1; }
	"$(VENV)/bin/python" docs/_tools/paper_pdf.py $(RELEASE)/$(NAME)-paper.pdf
	cp out/release/demo/skill.npz $(RELEASE)/$(NAME)-skill.npz
	tar -C out/release/demo -czf $(RELEASE)/$(NAME)-demonstrations.tar.gz demonstrations corrections
	tar -C out -czf $(RELEASE)/$(NAME)-site.tar.gz --transform 's,^docs,site,' docs
	cd $(RELEASE) && sha256sum -- * > SHA256SUMS && cat SHA256SUMS

# The site, in out/docs; runs the tutorials and the notebooks. Five minutes on a quiet core.
docs: environment
	$(RUN) pip install --quiet --editable ".[docs]" $(CONSTRAINTS:%=--constraint %)
	$(RUN) sphinx --fail-on-warning --keep-going --quiet --doctree-dir out/doctrees docs out/docs
	! grep --recursive --files-with-matches "&lt;Figure size" out/docs/notebooks  # a figure that is only named

# A stamp in the environment says that it is complete and newer than what it was made from.
environment .venv:
	@if [ ! -e "$(VENV)/ready" ] || [ -n "$$(find pyproject.toml constraints -newer "$(VENV)/ready")" ]; then \
	  echo "setting up $(VENV) with Python $(VERSION)"; \
	  "$(INTERPRETER)" -m venv "$(VENV)" && \
	  $(RUN) pip install --quiet --upgrade pip 2> "$(VENV)/install.log" && \
	  $(RUN) pip install --quiet --editable ".[dev]" $(CONSTRAINTS:%=--constraint %) 2> "$(VENV)/install.log" && \
	  $(RUN) scripts.compilation && \
	  touch "$(VENV)/ready" || { cat "$(VENV)/install.log"; exit 1; }; \
	fi

system-packages:
	@.ci/system-packages

clean:
	rm -rf out .venv .venv-3.*
