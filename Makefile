# One command each: `make help` lists them. Everything runs in a virtual environment of its own.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
unexport PYTHONDONTWRITEBYTECODE # tests and jobs start hundreds of processes
NATIVE := $(shell find texgs/raster/csrc -name '*.h' -o -name '*.cpp' -o -name '*.cu' -o -name '*.cuh' -o -name '*.txt')
FORMATTED := $(filter-out %.txt,$(NATIVE)) $(shell find tests -name '*.h' -o -name '*.cpp' -o -name '*.cu' -o -name '*.cuh')

.PHONY: help install again test test-all test-cpus test-cluster bench lint demo lock newest cross clean

help:
	@echo "make demo      from a small generated volume to an edited scene and results/report.html"
	@echo "make test      test all but what the next one adds; ARGS='-k name' picks some of all tests"
	@echo "make test-all  all of them: also whole runs, commands of the documentation, browser, wheel, emulated CUDA"
	@echo "make test-cpus  numerical tests as x86-64 CPUs without AVX-512 run them, and without AVX2"
	@echo "make test-cluster  run the cluster profile on a real SLURM on this machine, where that is installed"
	@echo "make bench     measure speed and memory, write JSON under benchmarks/"
	@echo "make lint      ruff, mypy, clang-format, snakefmt, snakemake --lint and the import layers"
	@echo "make install   compile what has changed and install it, without running anything; CUDA=1: for GPUs, too"
	@echo "make cross     compile for aarch64 by GCC and clang, and test the rasterizer there under emulation"
	@echo "make lock      resolve requirements.lock anew"
	@echo "make newest    test with the newest releases of all packages, in an environment of its own"
	@echo "make clean     remove the environment and everything built"
	@echo "The first of them creates $(VENV) with $(PYTHON) (3.11 to 3.14) and compiles the native library."

install: $(VENV)/installed
	@echo "texgs is installed in $(VENV). Next: source $(BIN)/activate, and then texgs doctor or make demo."

# A worker for each core, with a thread each. Tests that ARGS picks: one process, without that overhead.
WORKERS := OMP_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses auto --maxprocesses 8 --dist loadfile --no-loadscope-reorder
SLOW := workflow or stages or docs or packaging or browser or emulated or subprocess
test: $(VENV)/installed
ifdef ARGS
	$(BIN)/python -m pytest $(ARGS)
else
	$(WORKERS) -m "not ($(SLOW))"
endif

test-all: $(VENV)/installed
	$(WORKERS)

# There PyTorch rounds, and NumPy orders what is alike, in another way. Kernels: tests/raster/test_instruction_sets.py.
NUMERICAL := -m "not ($(SLOW))" $(addprefix tests/,fields metrics scene)
test-cpus: $(VENV)/installed
	TEXGS_ISA=avx2 ATEN_CPU_CAPABILITY=avx2 NPY_DISABLE_CPU_FEATURES="X86_V4 AVX512_ICL AVX512_SPR" \
	$(WORKERS) $(NUMERICAL) $(addprefix tests/,edit fitting volume)
	TEXGS_ISA=portable ATEN_CPU_CAPABILITY=default NPY_DISABLE_CPU_FEATURES="X86_V3 X86_V4 AVX512_ICL AVX512_SPR" \
	$(WORKERS) $(NUMERICAL)

# Opt-in: it starts the daemons of SLURM. Without them it is skipped and says what to install.
test-cluster: $(VENV)/installed
	@$(PIP) install snakemake-executor-plugin-slurm
	TEXGS_TEST_CLUSTER=1 $(BIN)/python -m pytest -rs tests/cluster $(ARGS)

bench: $(VENV)/installed
	OMP_PROC_BIND=true $(BIN)/python -m benchmarks $(ARGS)

demo: $(VENV)/installed
	$(BIN)/texgs run experiment=demo $(ARGS)

lint: $(VENV)/dependencies
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/hadolint Dockerfile
	$(BIN)/clang-format --dry-run -Werror $(FORMATTED)
	$(BIN)/mypy
	$(BIN)/snakefmt --check Snakefile workflow
	$(BIN)/snakemake --lint
	$(BIN)/python -m pytest tests/test_layers.py

$(if $(filter-out 0 1,$(CUDA)),$(error CUDA: expected 1 to compile the CUDA library or 0 not to, got $(CUDA)))
# CMake writes into the source tree, and remembers its options; pip has only to find what is there.
CONFIGURE = $(BIN)/cmake -S . -B build/editable -G Ninja -DCMAKE_MAKE_PROGRAM=$(abspath $(BIN)/ninja) \
	-DPython_EXECUTABLE=$(abspath $(BIN)/python) --log-level=WARNING \
	$(if $(filter 1,$(CUDA)),-DTEXGS_CUDA=ON) $(if $(filter 0,$(CUDA)),-DTEXGS_CUDA=OFF) $(CMAKE_ARGS)
$(VENV)/installed: $(VENV)/dependencies pyproject.toml CMakeLists.txt texgs/core/native_sources.py $(NATIVE) $(if $(filter 0 1,$(CUDA)),again)
	@echo "Compiling the native library: steps done, of all, and seconds"
	@$(CONFIGURE)
	@NINJA_STATUS='[%f/%t %es] ' $(BIN)/cmake --build build/editable
	@$(PIP) install --no-build-isolation --no-deps --config-settings wheel.cmake=false --editable .
	@sed -n 's/^TEXGS_LEFT_OUT:INTERNAL=\(..*\)/Left out: the CUDA library, \1. Compile it by: make install CUDA=1/p' build/editable/CMakeCache.txt
	@touch $@

# pip would compile the 23,000 modules one by one. Some packages hold files that are no Python.
$(VENV)/dependencies: requirements.lock requirements-torch.lock
	@$(PYTHON) tools/check_python.py
	@echo "Creating $(VENV)"
	@$(PYTHON) -m venv $(VENV)
	@echo "Installing the packages of requirements*.lock (torch alone is 200 MB, several GB with CUDA)"
	@$(PIP) install --no-compile --no-deps --require-hashes --requirement requirements.lock
	@$(PIP) install --no-compile $$($(PYTHON) tools/torch_index.py) --requirement requirements-torch.lock
	@$(BIN)/python -m compileall -qq -j 0 $(VENV)/lib || true
	@$(PIP) check
	@touch $@

lock: $(VENV)/dependencies
	@echo "Resolving pyproject.toml"
	@$(BIN)/python tools/lock.py > requirements.lock.new
	@mv requirements.lock.new requirements.lock
	@$(PIP) install --no-compile --no-deps --require-hashes --requirement requirements.lock
	@$(BIN)/python tools/licences.py > docs/licences.md
	@echo "Wrote requirements.lock and docs/licences.md"

# Bounds of pyproject.toml are ignored: this shows what raising them would break.
newest: $(VENV)/installed
	@$(BIN)/python tools/newest.py build/newest
ifdef ARGS
	build/newest/bin/python -m pytest $(ARGS)
else
	$(subst $(BIN),build/newest/bin,$(WORKERS)) -m "not ($(SLOW))"
endif

cross: $(VENV)/dependencies
	@BIN=$(BIN) tools/cross.sh

clean:
	rm -rf $(VENV) build dist texgs/raster/_native .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find texgs tests benchmarks tools -name __pycache__ -type d -prune -exec rm -rf {} +
