"""The way of an episode in pieces that can be drawn: stretches, dashes, a lane beside it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Way = NDArray[np.float64]
"""(k, 3): simulated seconds, x and y in metres."""


def stretch(way: Way, begin: float, end: float) -> Way:
    """Returns the part of a way between two times, its ends interpolated; may have no points."""
    if len(way) == 0 or end < way[0, 0] or begin > way[-1, 0]:
        return way[:0]
    begin, end = max(begin, way[0, 0]), min(end, way[-1, 0])
    inside = way[(way[:, 0] > begin) & (way[:, 0] < end)]
    ends = [_at(way, t) for t in (begin, end)]
    return np.vstack([ends[:1], inside, ends[1:]])


def without(way: Way, spans: tuple[tuple[float, float], ...]) -> tuple[Way, ...]:
    """Returns what is left of a way when the parts between some times are cut out."""
    pieces, begin = [], -np.inf
    for span_begin, span_end in (*sorted(spans), (np.inf, np.inf)):
        piece = stretch(way, begin, span_begin)
        if len(piece) > 1 and piece[-1, 0] > piece[0, 0]:
            pieces.append(piece)
        begin = span_end
    return tuple(pieces)


def beside(way: Way, offset: float) -> Way:
    """Returns the way moved to its left by up to ``offset`` metres, not at its two ends.

    So a leg that retraces another one can be told from it.
    """
    way = way[np.r_[True, np.hypot(*np.diff(way[:, 1:], axis=0).T) > 1e-6]] if len(way) else way
    if len(way) < 3:
        return way
    tangents = np.gradient(way[:, 1:], axis=0)
    lengths = np.maximum(np.hypot(*tangents.T), 1e-9)
    normals = np.column_stack([-tangents[:, 1], tangents[:, 0]]) / lengths[:, None]
    gone = arc_length(way)
    taper = np.clip(np.minimum(gone, gone[-1] - gone) / (3.0 * offset), 0.0, 1.0)
    return np.column_stack([way[:, 0], way[:, 1:] + normals * (offset * taper)[:, None]])


def dashes(way: Way, dash: float, gap: float) -> tuple[Way, ...]:
    """Returns the dashes of a dashed way; lengths in metres."""
    if len(way) < 2:
        return ()
    gone = arc_length(way)
    pieces = []
    for begin in np.arange(0.0, gone[-1], dash + gap):
        end = min(begin + dash, gone[-1])
        inside = way[(gone > begin) & (gone < end)]
        ends = [np.array([np.interp(s, gone, way[:, i]) for i in range(3)]) for s in (begin, end)]
        pieces.append(np.vstack([ends[:1], inside, ends[1:]]))
    return tuple(pieces)


def arc_length(way: Way) -> NDArray[np.float64]:
    """Returns the (k,) metres gone at each point."""
    steps = np.hypot(*np.diff(way[:, 1:], axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _at(way: Way, t: float) -> NDArray[np.float64]:
    return np.array([t, *(np.interp(t, way[:, 0], way[:, i]) for i in (1, 2))])
