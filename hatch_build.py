"""Packs ``models/``, ``prompts/`` and the cassettes of ``examples/`` into standard wheels.

A plain ``force-include`` would also leave a stale copy beside an editable install, where the
checkout itself must be read.
"""

from __future__ import annotations

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class PackageDataHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds the data folders to the wheel as parts of the package."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Force-includes the data folders unless the target is an editable install."""
        if version == "standard":
            for folder in ("models", "prompts", "examples/cassettes"):
                build_data["force_include"][folder] = f"unilavira_drake/{folder}"
