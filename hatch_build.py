"""A wheel with the engine's machine code, whose first farm starts without a compilation.

``PNFARM_MACHINE_CODE=1 pip wheel --no-build-isolation .`` compiles for any machine of this architecture
(``pnfarm/table/compiling/processor.py``).  The environment needs what ``locks/build.txt`` and ``locks/runtime.txt``
name.  Without the variable the wheel is one for every platform.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.builders.wheel import WheelBuilderConfig

ASKED = "PNFARM_MACHINE_CODE"
#: The oldest glibc on which Numba runs; the machine code itself calls none but mathematical functions.
PLATFORM = "manylinux_2_17"


class MachineCode(BuildHookInterface[WheelBuilderConfig]):
    """Compiles, and puts the code into the package."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called before the wheel is written."""
        if not os.environ.get(ASKED) or version == "editable":
            return
        # removed when this object is: after the wheel was written
        self._folder = tempfile.TemporaryDirectory(prefix="pnfarm-code-")
        # compiled anew with one order of hashes: the same octets each time
        with tempfile.TemporaryDirectory(prefix="pnfarm-cache-") as cache:
            subprocess.run(
                [sys.executable, "-m", "pnfarm.engine.warm", "--copy-to", self._folder.name], check=True,
                env={**os.environ, "PYTHONPATH": self.root, "PYTHONHASHSEED": "0", "NUMBA_CACHE_DIR": cache},
            )  # fmt: skip
        build_data["force_include"][self._folder.name] = "pnfarm/machine_code"
        build_data["pure_python"] = False
        python = f"cp{sys.version_info.major}{sys.version_info.minor}"
        build_data["tag"] = f"{python}-{python}-{PLATFORM}_{platform.machine()}"
