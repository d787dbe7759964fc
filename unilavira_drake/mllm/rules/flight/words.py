"""The words of the outdoors: landmarks, and what lies on the ground."""

from __future__ import annotations

from unilavira_drake.mllm.rules.vocabulary import color_name, singulars, thing_class

LANDMARKS: dict[str, tuple[str, ...]] = {
    "building": ("block", "office building", "apartment building", "tower block", "high rise",
                 "skyscraper", "warehouse", "hall"),
    "house": ("cottage", "villa", "home"),
    "church": ("chapel", "cathedral"),
    "tower": ("church tower", "clock tower", "water tower", "bell tower"),
    "school": (), "hospital": (), "hotel": (), "town hall": ("city hall",), "station": (),
    "shop": ("store", "bakery", "supermarket", "market hall", "cafe"),
    "factory": (), "garage": (), "barn": (), "shed": ("hut", "kiosk"), "fire station": (),
    "library": (), "museum": (), "gas station": ("petrol station",), "greenhouse": (),
    "roof": ("rooftop",), "chimney": (), "antenna": (), "crane": (), "bridge": (),
    "tree": ("oak", "palm", "palm tree", "trees", "pine", "fir"), "hedge": ("bush", "bushes"),
    "street lamp": ("lamp post", "lamppost", "street light", "lantern", "lamp"),
    "car": ("suv", "sedan", "vehicle", "taxi"), "bus": ("coach",),
    "truck": ("lorry", "van", "delivery van"), "bicycle": ("bike",), "motorcycle": (),
    "boat": ("ship",), "container": (), "tent": ("pavilion",), "bandstand": ("gazebo",),
    "fountain": (), "statue": ("monument",), "bench": ("park bench",), "playground": ("swing",),
    "bus stop": ("shelter",), "traffic light": (), "traffic cone": ("cone",), "sign": (),
    "fence": (), "wall": (), "deck chair": (), "person": ("man", "woman", "people", "pedestrian"),
    "road": ("street", "avenue", "lane", "highway", "main road", "main street", "alley"),
    "crossroads": ("crossing", "intersection", "junction", "roundabout"),
    "path": ("footpath", "trail", "track"), "pavement": ("sidewalk",),
    "square": ("plaza", "market square", "market place", "marketplace"),
    "car park": ("parking lot", "parking", "parking area"),
    "park": ("garden", "gardens"), "lawn": ("grass", "green"), "meadow": ("field",),
    "pond": ("lake", "pool", "water"), "river": ("stream", "canal"),
    "sports field": ("pitch", "football pitch", "football field", "soccer field"),
}  # fmt: skip
GROUND = (
    "road", "crossroads", "path", "pavement", "square", "car park", "park", "lawn", "meadow",
    "pond", "river", "sports field", "floor",
)  # fmt: skip
"""What lies flat: an aircraft goes over it."""
BUILDINGS = (
    "house", "church", "school", "hospital", "hotel", "town hall", "station", "shop", "factory",
    "garage", "barn", "shed", "fire station", "library", "museum", "gas station", "greenhouse",
    "tower",
)  # fmt: skip
WAYS = ("road", "path", "river", "pavement")
"""What one flies along."""
_GENERAL = {
    **dict.fromkeys(BUILDINGS, "building"),
    "bandstand": "tent", "lawn": "park", "meadow": "lawn", "pavement": "path",
}  # fmt: skip

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
    return int(_GENERAL.get(seen) == wanted or _GENERAL.get(wanted) == seen)


def color_match(wanted: str, seen: str) -> bool:
    """Whether a colour word may be meant; seen against the sky gray and white are one."""
    pale = ("white", "gray", "beige")
    wanted, seen = color_name(wanted), color_name(seen)
    return not wanted or wanted == seen or (wanted in pale and seen in pale)
