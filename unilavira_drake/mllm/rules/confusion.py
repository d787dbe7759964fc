"""Which classes of things, and which kinds of rooms, are taken for each other."""

from __future__ import annotations

SIMILAR: tuple[tuple[str, ...], ...] = (
    ("sofa", "armchair", "bench"),
    ("chair", "office chair", "stool"),
    ("cabinet", "wardrobe", "bookshelf", "shelf"),
    ("nightstand", "dresser"),
    ("table", "dining table", "coffee table", "desk", "counter"),
    ("bed", "crib"),
    ("television", "monitor"),
    ("refrigerator", "washing machine", "dryer", "dishwasher"),
    ("stove", "oven", "microwave"),
    ("bathtub", "shower"),
    ("picture", "mirror", "window", "whiteboard"),
    ("plant", "cactus", "vase"),
    ("trash can", "basket", "box", "suitcase"),
    ("lamp", "coat rack"),
    ("living room", "dining room"),
    ("study", "private office", "library", "meeting room"),
    ("bedroom", "children's room"),
    ("bathroom", "laundry room"),
    ("kitchen", "storage room", "closet"),
    ("corridor", "entrance hall", "reception"),
)
"""Groups that look alike; the last six are kinds of rooms.  A name outside is never confused."""

_OTHERS = {name: tuple(n for n in group if n != name) for group in SIMILAR for name in group}


def similar(name: str) -> tuple[str, ...]:
    """Returns what a canonical class of things or kind of room may be taken for."""
    return _OTHERS.get(name, ())
