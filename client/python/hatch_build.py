"""Makes two wheels of one project: pure Python, and with the programs inside.

`hatchling build -t wheel` makes the pure one (`py3-none-any`), a client for every
system. With WHEELARM_WHEEL_PREFIX the wheel also carries what lies there in `bin`
and `share`, as `scripts/dist.sh` stages it; pip installs the programs beside
`python` and the assets to `share/wheelarm/assets`, where the programs look for
them. WHEELARM_WHEEL_PLATFORM is its platform tag, for example
`manylinux_2_28_x86_64`: pip prefers it where it fits.

pyproject.toml names this file by one line: `[tool.hatch.build.targets.wheel.hooks.custom]`.
"""

import os
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PREFIX = "WHEELARM_WHEEL_PREFIX"
PLATFORM = "WHEELARM_WHEEL_PLATFORM"
PROGRAMS = ("wheelarm", "wheelarm-dataset", "wheelarm-server", "wheelarm-worker")
# Of the prefix: what a virtual environment has a use for.
SHARED = (
    "share/wheelarm",
    "share/man",
    "share/doc",
    "share/bash-completion",
    "share/zsh",
    "share/fish",
)


class ProgramsHook(BuildHookInterface):
    """Adds programs and assets to the wheel where a prefix is named."""

    PLUGIN_NAME = "custom"

    def initialize(self, version, build_data):
        """Fills `build_data` before the wheel is written."""
        named = os.environ.get(PREFIX)
        if self.target_name != "wheel" or version == "editable" or not named:
            return
        platform = os.environ.get(PLATFORM)
        if not platform:
            raise SystemExit(
                f"{PREFIX} is set, but {PLATFORM} is not; for example {PLATFORM}=manylinux_2_28_x86_64"
            )
        prefix = Path(named).resolve()
        programs = [prefix / "bin" / name for name in PROGRAMS]
        missing = [
            path
            for path in (*programs, prefix / "share/wheelarm/assets/scenes")
            if not path.exists()
        ]
        if missing:
            raise SystemExit(
                f"{PREFIX}={named} lacks {missing[0]}; make the prefix by: scripts/dist.sh programs archive"
            )
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform}"
        build_data["shared_scripts"].update({str(path): path.name for path in programs})
        build_data["shared_data"].update(
            {str(prefix / part): part for part in SHARED if (prefix / part).is_dir()}
        )
