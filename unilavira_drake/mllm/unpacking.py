"""The body of an answer, unpacked no further than it is allowed to grow."""

from __future__ import annotations

import zlib


class BodyError(Exception):
    """A body cannot be read; ``retryable`` tells whether another one may be better."""

    def __init__(self, message: str, *, retryable: bool) -> None:
        super().__init__(message)
        self.retryable = retryable


class Unpacker:
    """Collects a body chunk by chunk and undoes its ``Content-Encoding``.

    Not more than one byte over the limit is ever unpacked, so a small body that would unfold to
    gigabytes costs nothing.

    Raises:
        BodyError: if the encoding is neither gzip nor deflate; from the other methods, if the
            body is too large or damaged.
    """

    def __init__(self, encoding: str, max_bytes: int) -> None:
        self._encoding = encoding.strip().lower()
        if self._encoding not in {"", "identity", "gzip", "x-gzip", "deflate"}:
            raise BodyError(
                f"the body has the encoding {self._encoding[:40]!r}, which was not asked for.",
                retryable=False,
            )
        self._max_bytes = max_bytes
        self._body = bytearray()
        self._stream: zlib._Decompress | None = None

    def announce(self, content_length: str) -> None:
        """Refuses a body that says itself that it is too large."""
        if content_length.isdecimal() and int(content_length[:20]) > self._max_bytes:
            raise self._too_large()

    def feed(self, chunk: bytes) -> None:
        """Takes the next bytes as they came."""
        if self._encoding in {"", "identity"}:
            self._body += chunk
        else:
            self._unpack(chunk)
        if len(self._body) > self._max_bytes:
            raise self._too_large()

    def finish(self) -> bytes:
        """Returns the whole body."""
        if self._stream is not None and not self._stream.eof:
            raise BodyError("the packed body is cut off.", retryable=True)
        return bytes(self._body)

    def _unpack(self, chunk: bytes) -> None:
        while chunk:
            if self._stream is None:
                # "deflate" means a zlib stream, but some servers send a bare one.
                bare = self._encoding == "deflate" and chunk[0] & 0x0F != 8
                self._stream = zlib.decompressobj(-zlib.MAX_WBITS if bare else zlib.MAX_WBITS | 32)
            elif self._stream.eof:  # Another packed piece follows the first.
                self._stream = zlib.decompressobj(zlib.MAX_WBITS | 32)
            room = self._max_bytes + 1 - len(self._body)
            try:
                self._body += self._stream.decompress(chunk, room)
            except zlib.error:
                raise BodyError("the packed body is damaged.", retryable=True) from None
            if len(self._body) > self._max_bytes:
                return
            chunk = self._stream.unused_data

    def _too_large(self) -> BodyError:
        return BodyError(f"the body has more than {self._max_bytes} bytes.", retryable=False)
