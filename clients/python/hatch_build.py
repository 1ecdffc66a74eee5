"""Puts the program `signorini` into the wheel if SIGNORINI_WHEEL_PROGRAM names it; else the wheel is pure Python.

The script `wheel` beside this file sets the variables; SIGNORINI_WHEEL_PLATFORM is the tag of the platform, and
SIGNORINI_WHEEL_LICENCES a file with the licences of what the program contains. Those of the client itself are in every
wheel.
"""

from __future__ import annotations

import os
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ProgramHook(BuildHookInterface):  # type: ignore[type-arg]
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        program = os.environ.get("SIGNORINI_WHEEL_PROGRAM")
        # an editable wheel is for those who work on the client: they have a program of their own
        if program and version == "standard":
            build_data["shared_scripts"][program] = "signorini"
            licences = f"{self.metadata.name.replace('-', '_')}-{self.metadata.version}.dist-info/licenses"
            build_data["force_include"][os.environ["SIGNORINI_WHEEL_LICENCES"]] = f"{licences}/LICENSES-PROGRAM.txt"
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{os.environ['SIGNORINI_WHEEL_PLATFORM']}"
