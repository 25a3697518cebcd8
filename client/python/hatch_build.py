"""Builds two wheels of one project: pure Python, and one with the programs.

`hatchling build -t wheel` builds the pure one (`py3-none-any`), a client for every system.
With WHEELARM_WHEEL_PREFIX the wheel also contains `bin` and `share` of that prefix, as
staged by `scripts/dist.sh`; pip installs the programs next to `python` and the assets to
`share/wheelarm/assets`, where the programs search for them. WHEELARM_WHEEL_PLATFORM is its
platform tag, for example `manylinux_2_28_x86_64`; pip prefers this wheel on a matching
platform.

`[tool.hatch.build.targets.wheel.hooks.custom]` in pyproject.toml enables this file.
"""

import os
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PREFIX = "WHEELARM_WHEEL_PREFIX"
PLATFORM = "WHEELARM_WHEEL_PLATFORM"
PROGRAMS = ("wheelarm", "wheelarm-dataset", "wheelarm-server", "wheelarm-worker")
# Folders of the prefix that are useful in a virtual environment.
SHARED = (
    "share/wheelarm",
    "share/man",
    "share/doc",
    "share/bash-completion",
    "share/zsh",
    "share/fish",
)


class ProgramsHook(BuildHookInterface):
    """Adds programs and assets to the wheel if a prefix is set."""

    PLUGIN_NAME = "custom"

    def initialize(self, version, build_data):
        """Fills `build_data` before the wheel is written."""
        chosen = os.environ.get(PREFIX)
        if self.target_name != "wheel" or version == "editable" or not chosen:
            return
        platform = os.environ.get(PLATFORM)
        if not platform:
            raise SystemExit(
                f"{PREFIX} is set without {PLATFORM}: set it, for example to manylinux_2_28_x86_64"
            )
        prefix = Path(chosen).resolve()
        programs = [prefix / "bin" / name for name in PROGRAMS]
        missing = [
            path
            for path in (*programs, prefix / "share/wheelarm/assets/scenes")
            if not path.exists()
        ]
        if missing:
            raise SystemExit(
                f"{PREFIX}={chosen} lacks {missing[0]}: create it with scripts/dist.sh programs archive"
            )
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform}"
        build_data["shared_scripts"].update({str(path): path.name for path in programs})
        build_data["shared_data"].update(
            {str(prefix / part): part for part in SHARED if (prefix / part).is_dir()}
        )
