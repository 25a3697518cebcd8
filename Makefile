# make demo    records one episode of the mustard task and shows pictures of it
# make static  the same programs with HDF5 inside, in target/static (needs CMake 3.26)
# make test    format, lints, documentation and all tests, as CI runs them
# make contract    writes proto/contract.txt after a change of the .proto files
# make people WHEEL=FILE   makes assets/people again (assets/people/README.md)
# make test-cluster   a campaign on a one-node Slurm cluster in this machine
# make test-readers   loads exports in lerobot 0.4.4 and 0.6.1 (needs Python 3.12 too) and
#                     robomimic 0.3 (downloads gigabytes): features, videos, depth, language;
#                     holds joint signals against Pinocchio
# make test-data    what a scene draws does not tell the task: 1,000 seeds of every task
#                   against three classifiers, and the old draws, which did; sentences are
#                   counted, and 500 answers of labelled episodes computed again
# make test-adversarial   200 operators who mean harm, a minute each, sixty of them at the bear
# make soak    300 short episodes one right after the other, every file checked
# make test-original SCRIPTS=DIR   WheelArm-Sim's processing scripts on an episode of ours
# make bench   step, kinematics, cameras and recording beside their references

CARGO ?= cargo
OUT ?= data/demo
SEED ?= 0
STATIC ?= target/static
PLAN ?= assets/campaigns/small.toml
BUILT := $(or $(CARGO_TARGET_DIR),target)/release
export WHEELARM_COMMIT ?= $(shell git rev-parse --short=12 HEAD 2>/dev/null)
export WHEELARM_PYTHON ?= $(CURDIR)/.venv/bin/python

.PHONY: all build static demo test contract people test-cluster test-readers test-data test-original test-adversarial soak bench clean
all: build

build:
	scripts/setup.sh
	$(CARGO) build --release --bins

# The programs with HDF5 inside: they name no libhdf5, libcurl or libssl.
# Needs CMake 3.26 or newer.
static:
	scripts/setup.sh
	$(CARGO) build --release --bins --features wheelarm-client/static-hdf5,wheelarm-dataset/static-hdf5 --target-dir $(STATIC)
	! ldd $(STATIC)/release/wheelarm $(STATIC)/release/wheelarm-dataset | grep -E 'libhdf5|libcurl|libssl'

demo: build
	$(BUILT)/wheelarm demo --seed $(SEED) --out $(OUT)

test:
	scripts/setup.sh chromium
	scripts/setup.sh python numpy h5py pyarrow mcap protobuf:google.protobuf foxglove-schemas-protobuf:foxglove_schemas_protobuf
	$(CARGO) fmt --all --check
	$(CARGO) clippy --release --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release --workspace --no-deps
	$(CARGO) build --release --workspace --bins --tests
	$(CARGO) test --release --workspace
	$(WHEELARM_PYTHON) tests/python/check_people.py

contract:
	WHEELARM_WRITE_CONTRACT=1 $(CARGO) test --release -p wheelarm-proto --test evolution

people:
	scripts/setup.sh python numpy pillow:PIL
	$(WHEELARM_PYTHON) scripts/people/make_people.py $(WHEEL)
	$(WHEELARM_PYTHON) tests/python/check_people.py
	$(WHEELARM_PYTHON) scripts/people/look_at_people.py guide client/guide/images/people.png

test-cluster:
	scripts/setup.sh python kubernetes-validate:kubernetes_validate
	$(CARGO) build --release --workspace --bins
	tests/cluster.sh $(PLAN)

test-readers: build
	scripts/setup.sh python
	tests/readers.sh

test-data:
	scripts/setup.sh python numpy h5py scikit-learn:sklearn
	$(CARGO) build --release --workspace --bins --examples
	$(WHEELARM_PYTHON) tests/python/guess_task.py --before tests/data/draws-before.csv.gz \
		--server $(BUILT)/wheelarm-server --assets assets
	tests/labels.sh

test-adversarial:
	scripts/setup.sh
	$(CARGO) build --release --workspace --bins
	$(BUILT)/adversarial

soak:
	scripts/setup.sh
	$(CARGO) build --release --workspace --bins --examples
	$(BUILT)/examples/soak

test-original: build
	tests/original.sh $(SCRIPTS)

bench:
	scripts/setup.sh python numpy h5py mujoco
	$(CARGO) build --release --workspace --bins --examples
	tests/bench.sh

clean:
	$(CARGO) clean
