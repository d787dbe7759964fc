"""Any model backend behind both wire formats, on this machine only."""

from unilavira_drake.serving.server import DEFAULT_PORT, ModelServer

__all__ = ["DEFAULT_PORT", "ModelServer"]
