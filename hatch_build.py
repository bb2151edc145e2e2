"""Adds the compiled functions to a wheel where there is a C compiler; else the wheel is of Python alone."""

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PURE = "WALLRIDE_PURE_WHEEL"
"""Environment variable; "1": leave the compiled functions out."""


class KernelHook(BuildHookInterface[Any]):
    """Builds `wallride.drivers._accelerated` into the wheel. An editable install has `wallride build-kernel`."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build, and declare the wheel to be of this platform; where it cannot be built, say why and go on."""
        if version == "editable" or os.environ.get(PURE) == "1":
            return
        sys.path.insert(0, self.root)
        from wallride.runtime.kernel.build import FILE, BuildError, build

        self._scratch = tempfile.TemporaryDirectory()
        made = Path(self._scratch.name) / FILE
        try:
            build(Path(self.root), made)
        except BuildError as error:
            self.app.display_warning(f"wallride: the hot functions stay in Python: {error}")
            return
        build_data["pure_python"] = False
        build_data["infer_tag"] = True
        build_data["force_include"][str(made)] = f"wallride/drivers/{FILE}"
