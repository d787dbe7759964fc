"""``unilavira doctor``: is this machine able?"""

from __future__ import annotations

from unilavira_drake.recording.result import installed_versions
from unilavira_drake.rendering_check import check_rendering
from unilavira_drake.resources import models_path, prompts_path
from unilavira_drake.scenario import RENDERERS


def doctor() -> None:
    """Checks that episodes can run here, and says how to repair what cannot."""
    for name, version in installed_versions().items():
        print(f"ok  {name} {version}")
    for folder in (models_path(), prompts_path()):
        print(f"ok  {folder}")
    for renderer in RENDERERS:
        check_rendering(renderer=renderer)
        print(f"ok  rendering with {renderer}")
