"""The words of the outdoors: landmarks, and what lies on the ground."""

from __future__ import annotations

from unilavira_drake.mllm.rules.vocabulary import color_name, singulars, thing_class

LANDMARKS: dict[str, tuple[str, ...]] = {
    "building": ("block",),
    "apartment block": ("apartment building", "block of flats", "apartment house"),
    "office building": ("office block", "offices"),
    "office tower": ("tower block", "high rise", "skyscraper", "glass tower"),
    "house": ("cottage", "villa", "home"), "farmhouse": ("farm house",), "hut": ("shed",),
    "church": ("chapel", "cathedral", "church tower", "steeple"),
    "tower": ("clock tower", "bell tower", "hose tower"), "water tower": (),
    "school": (), "kindergarten": ("nursery school",), "hospital": (), "hotel": (),
    "town hall": ("city hall",), "court house": ("courthouse", "court"), "library": (),
    "museum": (), "post office": (), "bank": (), "pharmacy": ("chemist",), "cinema": ("theatre",),
    "shop": ("store",), "bakery": (), "supermarket": (), "cafe": ("coffee shop",), "kiosk": (),
    "market hall": (), "garden centre": ("garden center", "nursery"), "station": (),
    "factory": (), "warehouse": (), "garage": (), "barn": (), "greenhouse": ("glasshouse",),
    "fire station": ("fire brigade",), "gas station": ("petrol station",),
    "sports hall": ("gym", "gymnasium"), "swimming hall": ("swimming pool", "indoor pool"),
    "club house": ("clubhouse",), "chimney": ("smokestack",), "roof": ("rooftop",),
    "antenna": (), "crane": (), "bridge": (),
    "tree": ("oak", "palm", "palm tree", "lime", "lime tree"),
    "conifer": ("fir", "pine", "spruce", "fir tree", "pine tree", "wood"), "poplar": (),
    "hedge": (), "bush": ("shrub",),
    "street lamp": ("lamp post", "lamppost", "street light", "lantern", "lamp"),
    "car": ("suv", "sedan", "taxi"), "bus": ("coach",), "van": ("delivery van", "minibus"),
    "truck": ("lorry", "fire engine", "fire truck"), "bicycle": ("bike",), "motorcycle": (),
    "vehicle": (), "boat": ("ship", "rowing boat"), "container": (), "tent": (),
    "pavilion": ("bandstand", "gazebo"), "market stall": ("stall", "market stand"),
    "fountain": (), "statue": ("monument", "sculpture"), "bench": ("park bench",),
    "swing": (), "bus stop": ("shelter",), "traffic light": (), "traffic cone": ("cone",),
    "sign": (), "fence": (), "wall": (), "deck chair": (),
    "person": ("man", "woman", "people", "pedestrian"),
    "road": ("street", "avenue", "highway", "main road", "main street"),
    "lane": ("alley",), "path": ("footpath", "trail", "gravel path"), "pavement": ("sidewalk",),
    "road junction": ("crossroads", "crossing", "intersection", "junction", "roundabout"),
    "zebra crossing": ("crosswalk", "pedestrian crossing"),
    "square": ("plaza", "market square", "market place", "marketplace", "church square"),
    "car park": ("parking lot", "parking", "parking area"), "gravel place": (),
    "yard": ("courtyard",), "school yard": ("schoolyard",), "playground": (),
    "park": (), "gardens": ("garden", "allotments"), "lawn": ("grass",), "meadow": (),
    "field": ("wheat field", "farmland"), "pond": ("lake", "pool", "water"),
    "river": ("stream", "canal"), "running track": ("track", "athletics track"),
    "sports field": ("pitch", "football pitch", "football field", "soccer field", "soccer pitch"),
    "old town": (), "market quarter": (), "school quarter": (), "housing estate": (),
    "business district": ("downtown",), "sports ground": ("stadium",), "farm": (), "depot": (),
    "industrial area": ("works",),
}  # fmt: skip
GROUND = (
    "road", "lane", "road junction", "zebra crossing", "path", "pavement", "square", "car park",
    "gravel place", "yard", "school yard", "playground", "park", "gardens", "lawn", "meadow",
    "field", "pond", "river", "running track", "sports field", "floor", "old town",
    "market quarter", "school quarter", "housing estate", "business district", "sports ground",
    "farm", "depot", "industrial area",
)  # fmt: skip
"""What lies flat: an aircraft goes over it."""
WAYS = ("road", "lane", "path", "river", "pavement")
"""What one flies along."""
_SHOPS = ("bakery", "supermarket", "cafe", "pharmacy", "kiosk", "garden centre", "market hall")
_GENERAL: dict[str, tuple[str, ...]] = {
    "building": (
        "apartment block", "office building", "office tower", "house", "farmhouse", "church",
        "tower", "school", "kindergarten", "hospital", "hotel", "town hall", "court house",
        "library", "museum", "post office", "bank", "cinema", "station", "factory", "warehouse",
        "garage", "barn", "greenhouse", "fire station", "gas station", "sports hall",
        "swimming hall", "club house", "shop", "hut", *_SHOPS,
    ),
    "shop": _SHOPS, "house": ("farmhouse",), "tower": ("office tower", "water tower"),
    "tree": ("conifer", "poplar"), "hedge": ("bush",),
    "vehicle": ("car", "bus", "van", "truck"), "truck": ("van",),
    "road": ("lane",), "path": ("pavement", "lane"), "yard": ("school yard",),
    "park": ("lawn", "gardens"), "field": ("meadow",), "hall": ("sports hall", "swimming hall"),
    "playground": ("swing",),
}  # fmt: skip
"""General class -> the special ones that it also names."""

_NAMES = {word: name for name, words in LANDMARKS.items() for word in (name, *words)}
_LONGEST = max(len(word.split()) for word in _NAMES)


def landmark_class(word: str) -> str:
    """Returns the canonical class of a landmark, or the word itself when it is unknown."""
    word = " ".join(word.lower().replace("_", " ").split())
    return _NAMES.get(word) or thing_class(word)


def landmark_at(words: list[str], start: int) -> tuple[str, int]:
    """Returns the class that a phrase of a text names and its number of words, 0 for none."""
    for length in range(min(_LONGEST, len(words) - start), 0, -1):
        part = words[start : start + length]
        for last in singulars(part[-1]):
            phrase = " ".join((*part[:-1], last))
            if phrase in _NAMES:
                return _NAMES[phrase], length
            known = thing_class(phrase)
            if known != phrase:
                return known, length
    return "", 0


def landmark_match(wanted: str, seen: str) -> int:
    """Returns 2 for the same class, 1 where one word is the more general one, else 0."""
    if wanted == seen:
        return 2
    return int(seen in _GENERAL.get(wanted, ()) or wanted in _GENERAL.get(seen, ()))


def looks(wanted: str, roof: str, seen: str, *, above: bool) -> int:
    """Returns 2 where a thing has the colour that is meant, 1 where only its light may differ.

    Args:
        wanted: colour word of the thing, or empty.
        roof: colour word of its roof, or empty.
        seen: colour that it shows.
        above: whether it is seen straight from above, where a dark thing in the sun looks pale.
    """
    if color_match(wanted, seen) or (roof and color_match(roof, seen)):
        return 2
    grays = ("white", "gray", "beige", "black")
    return int(above and color_name(wanted) in grays and color_name(seen) in grays)


def color_match(wanted: str, seen: str) -> bool:
    """Whether a colour word may be meant; seen against the sky gray and white are one."""
    pale = ("white", "gray", "beige")
    wanted, seen = color_name(wanted), color_name(seen)
    return not wanted or wanted == seen or (wanted in pale and seen in pale)
