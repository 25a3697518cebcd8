# make demo    records one episode of the mustard task and shows images of it
# make static  the same programs with HDF5 inside, in target/static (needs CMake 3.26)
# make release   the files of a release in dist/: archive, wheels, Debian package, image, crates,
#                bill of materials, notes, checksums (JOBS=N; `make dist` is the same)
# make test-release   installs the files of dist/ as the guides say, from a local package index
# make test-dist   installs and runs the packages of dist/ in clean Debian systems (as root)
# make test    format, lints, documentation and all tests, as CI runs them
# make contract    writes proto/contract.txt after a change of the .proto files
# make test-people   the chair camera's view of every body in every posture, and the
#                    assets (assets/people/README.md): some minutes
# make people WHEEL=FILE   makes assets/people again (assets/people/README.md)
# make test-cluster   a campaign on a one-node Slurm cluster on this machine
# make test-readers   loads exports in lerobot 0.4.4 and 0.6.1 (needs Python 3.12 too) and
#                     robomimic 0.3 (downloads gigabytes): features, videos, depth, language;
#                     compares joint signals with Pinocchio
# make test-rosbag2   decodes bags with rclpy of ROS 2 Jazzy and Kilted, rosbags and
#                     mcap-ros2-support, message by message (installs 0.8 GB)
# make contract-python   writes the Python package's part of the contract, after such a change
# make test-python   the Python package with Python 3.10 to 3.13 and protobuf 3.20 to 7: every
#                    task and mode, types, the guide, the notebook; downloads some packages
# make test-drive   the page that drives: every device, accessibility, a headset, and one switch that
#                   lifts the mustard on 12 seeds, in Chromium (installs it and four npm packages)
# make bench-drive   image rate, latency and control through the gateway on good and bad links
#                 (root: network namespaces)
# make test-lerobot   lerobot-eval and lerobot-record of 0.4.4 and 0.6.1 with our plugins, and
#                     rows of exports played open loop (downloads gigabytes)
# make test-ros     the ROS 2 node against the real rclpy of Kilted and Jazzy (from PyPI,
#                   built once in some minutes)
# make test-data    sampled values of a scene do not reveal the task: 1,000 seeds of every task
#                   with three classifiers, and an old table that reveals it; the same of the target
#                   in own homes with household objects; counts sentences,
#                   and computes 500 answers of labelled episodes again
# make test-learn   lints, documents and tests client/learn, which trains and serves networks, and
#                   checks that training in Python refuses what is kept for tests
#                   (burn, about nine minutes of one core the first time)
# make test-adversarial   200 adversarial operators, a minute each, sixty of them at the bear
#                         and 1,000 episodes that press the seated person under the guard
# make test-expert   the scripted expert, 20 seeds of each task from EXPERT_SEED: near and
#                    anywhere, without and with a person; about an hour on two cores;
#                    results in data/expert-COMMIT, where an interrupted run is resumed
# make test-variety   variety of demonstrations, 40 seeds of each task from EXPERT_SEED, and
#                    the rhythm of the style human, 6 seeds; about an hour on two cores;
#                    results in data/variety-COMMIT
# make test-import   imports the nine example homes of Sweet Home 3D (Debian's package is
#                    fetched once) and compares the packs with tests/data/homes.csv
# make assets    makes the objects of assets/kinds.toml again, in assets/packs: about a minute
# make test-objects   trials of each of them and of each grasp, in OBJECT_JOBS processes; writes
#                    the verdicts into assets/packs, and docs/results/objects.md. Some 6,000 trials,
#                    20 minutes on 16 cores; resumes from data/objects.jsonl
# make test-homes    makes 150 layouts of each own home, checks that they are ready, and writes
#                    docs/results/own-homes.md; then sentences about every home of the frozen
#                    worlds parse to what they ask for; some minutes
# make test-hashes   compares state hashes of 44 episodes with tests/data/redesign-hashes.csv, a
#                    minute and a half on two cores
# make docs    the documentation site in target/docs/site: guides, results, references of
#              commands, protocol, Python and Rust, executed notebooks; checks every link
# make soak    300 short episodes directly one after the other, every file checked
# make test-original SCRIPTS=DIR   WheelArm-Sim's processing scripts on an episode of ours
# make demo-policy   the distributed policy lifts the soup, or does POLICY_TASK=pick_blue_mug,
#                    from its own small images (builds client/learn first, about nine minutes
#                    of one core)
# make train-mustard   episodes, policy, corrections, policy, evaluation, on a big GPU (RUN=data/mustard)
# make train-tasks     one language-conditioned policy for all tasks, likewise (RUN=data/tasks)
# make train-multiplied   the same training on ten episodes, on the episodes multiplied from them,
#                    and on as many of the expert, likewise (RUN=data/multiplied)
# make bench   step, kinematics, cameras and recording with their references
# make bench-campaign   campaigns on a big GPU, three rounds, in data/bench-campaign; AGAINST=FILE
#                       compares with the report.json of a former run

CARGO ?= cargo
OUT ?= data/demo
SEED ?= 0
STATIC ?= target/static
RUN ?= data/mustard
EXPERT_SEED ?= 950000
POLICY_SEED ?= 557
POLICY_TASK ?= pick_tomato_soup
PLAN ?= assets/campaigns/small.toml
# More than two: most system tests wait for a server.
TEST_THREADS ?= $(shell n=$$(nproc); echo $$((n > 3 ? n : 3)))
# Examples that tests run; clippy checks the others.
RUN_EXAMPLES := --example camera --example memory --example policy
# GNU make 4.4 would give cargo its own two jobs.
ALONE := env -u MAKEFLAGS -u MFLAGS
# Another number of units than the profile's gives the crates of this repository names of their
# own: the lints check them, and find the others built.
LINT_UNITS := CARGO_PROFILE_RELEASE_CODEGEN_UNITS=15
BUILT := $(or $(CARGO_TARGET_DIR),target)/release
# In an empty target folder `make test` compiles all tests by clippy (scripts/rustc.sh).
ifndef LINT_TARGETS
LINT_TARGETS := $(if $(RUSTC_WRAPPER)$(wildcard $(BUILT)/deps)$(filter-out test,$(or $(MAKECMDGOALS),all)),--all-targets,--lib --bins --examples)
endif
export LINT_TARGETS
# Seconds until the lints begin; see there.
LINTS_AFTER ?= 20
# burn compiles for minutes: only `make test-learn` builds client/learn.
WITHOUT_LEARN := --exclude wheelarm-learn
# Empty in the copy that this test makes.
BUILD_TEST ?= tests/build.sh
export WHEELARM_COMMIT ?= $(shell git rev-parse --short=12 HEAD 2>/dev/null)
export WHEELARM_PYTHON ?= $(CURDIR)/.venv/bin/python
# Settings of another server in this shell must not affect servers that are started here.
unexport WHEELARM_CONNECT WHEELARM_KEYS WHEELARM_SIM WHEELARM_USER

.PHONY: all build static demo test test-learn lints unit-suites suites python-suite contract test-cluster test-readers test-data test-original test-adversarial test-hashes test-import test-expert test-variety docs soak train-mustard train-tasks train-multiplied demo-policy bench bench-campaign test-rosbag2 dist release test-release test-dist contract-python test-python test-lerobot test-drive bench-drive test-ros people test-people clean test-homes assets test-objects
all: build

build:
	scripts/setup.sh room 3
	scripts/setup.sh
	$(CARGO) build --release --bins

# The programs with HDF5 inside: they name no libhdf5, libcurl or libssl.
# Needs CMake 3.26 or newer.
static:
	scripts/setup.sh
	$(CARGO) build --release --bins --features wheelarm-cli/static-hdf5,wheelarm-dataset/static-hdf5,wheelarm-worker/static-hdf5 --target-dir "$(STATIC)"
	! ldd "$(STATIC)/release/wheelarm" "$(STATIC)/release/wheelarm-dataset" "$(STATIC)/release/wheelarm-worker" | grep -E 'libhdf5|libcurl|libssl'

dist release:
	scripts/dist.sh

test-release:
	tests/release.sh

test-dist:
	scripts/setup.sh python numpy h5py
	tests/dist.sh

demo: build
	"$(BUILT)/wheelarm" demo --seed $(SEED) --out "$(OUT)"

# A test that cannot run here fails. Lints and documentation are checked while tests run:
# most tests wait for servers in real time, and leave the cores idle.
test: export WHEELARM_NO_SKIPS = 1
test: export RUSTC_WRAPPER ?= $(CURDIR)/scripts/rustc.sh
test:
	scripts/setup.sh room 8
	scripts/setup.sh chromium
	scripts/setup.sh python numpy h5py pyarrow mcap protobuf:google.protobuf foxglove-schemas-protobuf:foxglove_schemas_protobuf \
		rosbags==0.11.9:rosbags eclipse-zenoh==1.10.2:zenoh gymnasium pytest grpcio-tools:grpc_tools
	$(BUILD_TEST)
	tests/drive.sh fast
	$(CARGO) fmt --all --check
	$(CARGO) build --release --workspace $(WITHOUT_LEARN) --bins --tests $(RUN_EXAMPLES)
	+$(MAKE) --no-print-directory -j 4 lints unit-suites suites python-suite

# Prints only what fails: the output of the tests appears at the same time. Begins when
# `cargo test` has released the lock of the target folder: else the tests would wait.
lints:
	sleep $(LINTS_AFTER); log=$$($(LINT_UNITS) RUSTC_WRAPPER="$(CURDIR)/scripts/lint.sh" $(ALONE) nice -n 19 \
		$(CARGO) build --release --workspace $(WITHOUT_LEARN) $(LINT_TARGETS) 2>&1) || { printf '%s\n' "$$log"; exit 1; }

# Unit tests compute, and the suites beside them mostly wait for servers. Both name all packages:
# another selection has other features, and compiles them again.
unit-suites: export WHEELARM_NO_SKIPS = 1
unit-suites: export WHEELARM_CACHE = $(if $(filter /%,$(BUILT)),$(BUILT),$(CURDIR)/$(BUILT))/test-cache-units
unit-suites:
	rm -rf "$(WHEELARM_CACHE)"
	RUST_TEST_THREADS=$(TEST_THREADS) $(ALONE) nice -n 5 $(CARGO) test --release --workspace $(WITHOUT_LEARN) --lib --bin wheelarm-dataset

suites: export WHEELARM_NO_SKIPS = 1
# Entries of other builds must not affect tests.
suites: export WHEELARM_CACHE = $(if $(filter /%,$(BUILT)),$(BUILT),$(CURDIR)/$(BUILT))/test-cache
suites:
	rm -rf "$(WHEELARM_CACHE)"
	RUST_TEST_THREADS=$(TEST_THREADS) $(ALONE) $(CARGO) test --release --workspace $(WITHOUT_LEARN) --test '*'

python-suite: export WHEELARM_NO_SKIPS = 1
python-suite: export WHEELARM_CACHE = $(if $(filter /%,$(BUILT)),$(BUILT),$(CURDIR)/$(BUILT))/test-cache-python
python-suite:
	rm -rf "$(WHEELARM_CACHE)"
	PYTHONPATH=client/python/src "$(WHEELARM_PYTHON)" -m pytest -q -m "not slow" client/python/tests

test-learn:
	scripts/setup.sh
	$(CARGO) fmt --package wheelarm-learn --check
	$(CARGO) clippy --release -p wheelarm-learn --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release -p wheelarm-learn --no-deps
	$(CARGO) test --release -p wheelarm-learn
	"$(WHEELARM_PYTHON)" tests/python/check_worlds.py

contract:
	WHEELARM_WRITE_CONTRACT=1 $(CARGO) test --release -p wheelarm-proto --test evolution

contract-python:
	scripts/setup.sh python grpcio-tools:grpc_tools
	"$(WHEELARM_PYTHON)" client/python/scripts/make_contract.py

test-python: build
	tests/python.sh

test-drive: build
	tests/drive.sh

bench-drive: build
	scripts/setup.sh python numpy eclipse-zenoh==1.10.2:zenoh protobuf:google.protobuf websockets
	"$(WHEELARM_PYTHON)" -W ignore::DeprecationWarning tests/drive/figures.py

test-lerobot: build
	tests/lerobot.sh

people:
	scripts/setup.sh python numpy pillow:PIL
	"$(WHEELARM_PYTHON)" assets/tools/people/make_people.py $(if $(WHEEL),"$(WHEEL)")
	"$(WHEELARM_PYTHON)" tests/python/check_people.py
	"$(WHEELARM_PYTHON)" assets/tools/people/look_at_people.py guide docs/images/people.png

test-hashes: build
	$(CARGO) test --release -p wheelarm-tests --test system -- --ignored of_all_episodes

test-import:
	$(CARGO) build --release -p wheelarm-cli --bin wheelarm
	WHEELARM="$(BUILT)/wheelarm" tests/import.sh

assets:
	$(CARGO) build --release -p wheelarm-cli --bin wheelarm
	meshes=$$(mktemp -d) && python3 assets/tools/object_meshes.py "$$meshes" --import "$(BUILT)/wheelarm"; \
		status=$$?; rm -rf "$$meshes"; exit $$status

test-objects:
	$(CARGO) build --release -p wheelarm-cli -p wheelarm-worker --bins
	WHEELARM="$(BUILT)/wheelarm" tests/objects.sh

test-homes:
	$(CARGO) build --release -p wheelarm-cli --bin wheelarm
	WHEELARM="$(BUILT)/wheelarm" tests/homes.sh
	$(CARGO) test --release -p wheelarm-server --lib sentences_about_all -- --ignored --nocapture

test-people:
	scripts/setup.sh python numpy
	"$(WHEELARM_PYTHON)" tests/python/check_people.py
	$(CARGO) test --release -p wheelarm-server --lib of_everybody -- --ignored --nocapture

test-cluster:
	scripts/setup.sh python kubernetes-validate:kubernetes_validate
	$(CARGO) build --release --workspace $(WITHOUT_LEARN) --bins
	tests/cluster.sh "$(PLAN)"

test-readers: build
	scripts/setup.sh python
	tests/readers.sh

test-rosbag2: build
	scripts/setup.sh python
	tests/rosbag2.sh

test-ros:
	scripts/setup.sh python
	$(CARGO) build --release --bins
	WHEELARM_SERVER="$(BUILT)/wheelarm-server" client/python/tests/ros/run.sh -s

test-data:
	scripts/setup.sh python numpy h5py scikit-learn:sklearn
	$(CARGO) build --release --workspace $(WITHOUT_LEARN) --bins --examples
	"$(WHEELARM_PYTHON)" tests/python/guess_task.py --before tests/data/draws-before.csv.gz \
		--server "$(BUILT)/wheelarm-server" --assets assets
	"$(WHEELARM_PYTHON)" tests/python/guess_task.py --server "$(BUILT)/wheelarm-server" --assets assets \
		--homes train --objects bath,care,kitchen,living --seeds 24 --plan assets/campaigns/worlds-1k.toml
	tests/labels.sh

test-adversarial:
	scripts/setup.sh
	$(CARGO) build --release --workspace $(WITHOUT_LEARN) --bins
	"$(BUILT)/adversarial"
	"$(BUILT)/adversarial" --guard 1000 --seconds 10

test-expert:
	scripts/setup.sh
	$(CARGO) build --release --bins
	python3 tests/bench/expert.py --programs "$(BUILT)" --out "data/expert-$(WHEELARM_COMMIT)" --first $(EXPERT_SEED) --jobs "$$(nproc)"

test-variety:
	scripts/setup.sh python numpy h5py
	$(CARGO) build --release --bins
	"$(WHEELARM_PYTHON)" tests/bench/variety.py --programs "$(BUILT)" --out "data/variety-$(WHEELARM_COMMIT)/quick" --first $(EXPERT_SEED) --jobs "$$(nproc)"
	"$(WHEELARM_PYTHON)" tests/bench/variety.py --programs "$(BUILT)" --out "data/variety-$(WHEELARM_COMMIT)/human" --style human --episodes 6 --tasks pick_mustard,pick_bowl,pick_tomato_soup,open_drawer --first $(EXPERT_SEED) --jobs "$$(nproc)"

docs: build
	scripts/setup.sh python numpy grpcio-tools:grpc_tools eclipse-zenoh==1.10.2:zenoh protobuf:google.protobuf gymnasium h5py nbconvert ipykernel matplotlib
	$(CARGO) doc --release --no-deps -p wheelarm-sdk -p wheelarm-proto -p wheelarm-policy
	"$(WHEELARM_PYTHON)" scripts/docs/build.py --programs "$(BUILT)" --rustdoc "$(or $(CARGO_TARGET_DIR),target)/doc" --out "$(or $(CARGO_TARGET_DIR),target)/docs"

soak:
	scripts/setup.sh
	$(CARGO) build --release --workspace $(WITHOUT_LEARN) --bins --examples
	"$(BUILT)/examples/soak"

test-original: build
	tests/original.sh $(if $(SCRIPTS),"$(SCRIPTS)")

# The policy that ships at work: on the processor, without Python.
demo-policy: build
	$(CARGO) build --release -p wheelarm-learn
	"$(BUILT)/wheelarm" demo --task $(POLICY_TASK) --policy act:assets/policies/tasks.safetensors --seed $(POLICY_SEED) --out data/demo-policy

train-mustard:
	scripts/setup.sh
	$(CARGO) build --release --bins
	client/learn/scripts/train_policy.sh "$(RUN)"

train-tasks: RUN := data/tasks
train-tasks:
	scripts/setup.sh
	$(CARGO) build --release --bins
	client/learn/scripts/train_tasks.sh "$(RUN)"

train-multiplied: RUN := data/multiplied
train-multiplied:
	scripts/setup.sh
	$(CARGO) build --release --bins
	client/learn/scripts/train_multiplied.sh "$(RUN)"

bench:
	scripts/setup.sh python numpy h5py mujoco
	$(CARGO) build --release --workspace $(WITHOUT_LEARN) --bins --examples
	tests/bench.sh

bench-campaign: build
	tests/bench/device.sh "$(BUILT)" assets data/bench-campaign --rounds 3 --seconds 1500 --into memory $(if $(AGAINST),--against "$(AGAINST)")

clean:
	$(CARGO) clean
