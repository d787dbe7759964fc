"""How long the models' replies are awaited, for those who stop a robot that waits too long."""

from __future__ import annotations

from pydrake.systems.framework import Context, LeafSystem

from unilavira_drake.messages import Awaited
from unilavira_drake.ports import message_input


class AwaitedReplies:
    """Declares the optional inputs ``language_awaited`` and ``vision_awaited``, and reads them.

    Args:
        system: whose inputs they are.
        timeout: from which on a reply is overdue, seconds.
    """

    def __init__(self, system: LeafSystem, timeout: float) -> None:
        self._timeout = timeout
        self._readers = tuple(
            message_input(system, f"{role}_awaited", Awaited()) for role in ("language", "vision")
        )

    def overdue(self, context: Context) -> bool:
        """Whether any reply has been awaited for longer than the timeout."""
        time = context.get_time()
        for reader in self._readers:
            awaited = reader.optional(context)
            since = None if awaited is None else awaited.since
            if since is not None and time - since > self._timeout:
                return True
        return False
