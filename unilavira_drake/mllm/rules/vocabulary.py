"""The words of homes: things, kinds of rooms, colours, and where things usually are."""

from __future__ import annotations

ROOMS: dict[str, tuple[str, ...]] = {
    "living room": ("lounge", "sitting room", "family room", "front room", "parlour", "parlor"),
    "kitchen": ("kitchenette", "cooking area"),
    "bathroom": ("washroom", "restroom", "shower room", "wc", "powder room", "lavatory"),
    "bedroom": ("master bedroom", "guest room", "guest bedroom", "sleeping room", "spare room"),
    "corridor": ("hall", "hallway", "passage", "passageway", "landing"),
    "study": ("office", "home office", "workroom", "study room", "office room"),
    "dining room": ("dining area", "eating area", "dining hall"),
    "laundry room": ("laundry", "utility room", "wash house"),
    "entrance hall": ("entrance", "entryway", "entry", "foyer", "vestibule", "lobby"),
    "children's room": ("nursery", "kids room", "childrens room", "child's room", "playroom"),
    "closet": ("walk in closet", "dressing room"),
    "storage room": ("storeroom", "store room", "storage", "pantry", "larder", "box room"),
    "meeting room": ("conference room", "board room", "boardroom"),
    "reception": ("reception area", "reception room"),
    "private office": ("manager's office", "director's office", "corner office"),
    "garage": ("carport",),
    "balcony": ("terrace", "patio", "veranda"),
    "library": ("reading room",),
    "gym": ("exercise room", "fitness room"),
    "stairwell": ("staircase", "stairs", "stairway"),
}
STAIRS = "stairs"
"""Category of a flight of stairs."""
HUBS = ("corridor", "entrance hall", "stairwell")
"""Rooms whose purpose is to lead to other rooms."""

THINGS: dict[str, tuple[str, ...]] = {
    "sofa": ("couch", "settee", "loveseat", "love seat"),
    "armchair": ("easy chair", "recliner", "lounge chair"),
    "chair": ("seat", "dining chair", "kitchen chair"),
    "office chair": ("desk chair", "swivel chair"),
    "stool": ("bar stool", "barstool", "footstool"),
    "bench": (),
    "ottoman": ("pouf", "footrest"),
    "bed": ("double bed", "single bed", "bunk bed"),
    "crib": ("cot", "baby bed"),
    "nightstand": ("bedside table", "night table", "bedside cabinet", "night stand"),
    "wardrobe": ("armoire",),
    "dresser": ("chest of drawers", "drawers", "drawer unit"),
    "cabinet": ("cupboard", "sideboard", "credenza"),
    "bookshelf": ("bookcase", "book shelf", "book case", "bookrack"),
    "shelf": ("shelving", "rack"),
    "table": ("side table",),
    "dining table": ("dinner table", "dining room table", "kitchen table"),
    "coffee table": ("tea table", "low table"),
    "desk": ("writing desk", "work desk", "writing table"),
    "counter": ("worktop", "countertop", "kitchen counter", "kitchen island", "bar counter"),
    "television": ("tv", "tv set", "telly", "television set", "tv monitor", "tv screen",
                   "television screen"),
    "monitor": ("computer screen", "screen", "computer monitor", "display"),
    "computer": ("pc", "desktop computer"),
    "laptop": ("notebook computer",),
    "printer": (),
    "lamp": ("floor lamp", "standing lamp", "table lamp", "light"),
    "plant": ("potted plant", "house plant", "houseplant", "flower pot", "pot plant"),
    "vase": (),
    "refrigerator": ("fridge", "freezer", "icebox"),
    "stove": ("cooker", "hob", "range", "cooktop"),
    "oven": (),
    "microwave": ("microwave oven",),
    "dishwasher": ("dish washer",),
    "kettle": (),
    "toaster": (),
    "washing machine": ("washer", "clothes washer", "laundry machine"),
    "dryer": ("tumble dryer", "clothes dryer", "drier"),
    "bathtub": ("bath tub", "tub", "bath"),
    "shower": ("shower cabin", "shower stall"),
    "toilet": ("loo", "toilet bowl", "toilet seat"),
    "sink": ("washbasin", "wash basin", "basin", "bathroom sink", "kitchen sink"),
    "towel": ("towel rail", "towel rack"),
    "mirror": ("looking glass",),
    "picture": ("painting", "poster", "picture frame"),
    "clock": ("grandfather clock", "wall clock"),
    "rug": ("carpet", "mat"),
    "curtain": ("drapes",),
    "window": (),
    "fireplace": ("hearth",),
    "piano": ("grand piano",),
    "guitar": (),
    "trash can": ("bin", "dustbin", "rubbish bin", "waste bin", "garbage can", "trash bin",
                  "wastebasket", "trashcan", "trash"),
    "basket": ("laundry basket", "hamper"),
    "box": ("crate", "carton"),
    "suitcase": ("luggage", "bag"),
    "bicycle": ("bike", "exercise bike"),
    "treadmill": (),
    "coat rack": ("coat stand", "hat stand", "coat hanger"),
    "shoe rack": ("shoe cabinet",),
    "radiator": ("heater",),
    "fan": (),
    "ironing board": (),
    "vacuum cleaner": ("vacuum", "hoover"),
    "teddy bear": ("toy", "soft toy"),
    "bean bag": ("beanbag",),
    "whiteboard": ("white board",),
    "sign": ("notice",),
    "water cooler": ("water dispenser",),
    "punching bag": ("punch bag", "boxing bag", "sandbag"),
    "exercise bench": ("weight bench", "workout bench"),
    "tv stand": ("tv cabinet", "tv table"),
    "fire extinguisher": (),
    "cactus": (),
    "aquarium": ("fish tank",),
    "loudspeaker": ("speaker",),
    "clothes rack": ("clothes rail",),
    "dressing table": ("vanity table",),
    "ping pong table": ("table tennis table",),
    "column": ("pillar",),
    "person": ("man", "woman", "people"),
}  # fmt: skip
GENERAL = {
    "armchair": "chair", "office chair": "chair", "stool": "chair",
    "dining table": "table", "coffee table": "table",
    "bookshelf": "shelf", "crib": "bed", "dresser": "cabinet",
    "oven": "stove", "shower": "bathtub",
}  # fmt: skip
"""Special class -> the more general word that also names it."""

COLORS: dict[str, tuple[str, ...]] = {
    "red": ("crimson", "scarlet", "maroon"),
    "orange": (),
    "yellow": ("golden", "gold", "mustard"),
    "green": ("olive", "lime"),
    "cyan": ("turquoise", "teal", "aqua"),
    "blue": ("navy", "azure"),
    "purple": ("violet", "lilac", "mauve", "lavender"),
    "pink": ("rose", "magenta"),
    "brown": ("wooden", "tan", "chestnut"),
    "white": ("ivory", "cream"),
    "gray": ("grey", "silver"),
    "black": (),
    "beige": (),
}

USUAL_ROOMS: dict[str, tuple[str, ...]] = {
    "living room": ("sofa", "armchair", "television", "coffee table", "fireplace", "ottoman"),
    "kitchen": ("refrigerator", "stove", "oven", "microwave", "dishwasher", "counter", "kettle",
                "toaster"),
    "bathroom": ("bathtub", "shower", "toilet", "towel", "mirror", "washing machine"),
    "bedroom": ("bed", "nightstand", "wardrobe", "dresser"),
    "study": ("desk", "office chair", "computer", "monitor", "printer", "laptop", "bookshelf"),
    "dining room": ("dining table",),
    "laundry room": ("washing machine", "dryer", "ironing board", "basket"),
    "entrance hall": ("coat rack", "shoe rack"),
}  # fmt: skip
"""Kind of room -> things usually found there: a habit, never a certainty."""


def _inverse(table: dict[str, tuple[str, ...]]) -> dict[str, str]:
    return {word: name for name, words in table.items() for word in (name, *words)}


ROOM_NAMES = _inverse(ROOMS)
THING_NAMES = _inverse(THINGS)
COLOR_NAMES = _inverse(COLORS)


def room_kind(word: str) -> str:
    """Returns the canonical kind of a room, or the word itself when it is unknown."""
    word = " ".join(word.lower().replace("_", " ").split())
    return ROOM_NAMES.get(word, word)


def thing_class(word: str) -> str:
    """Returns the canonical class of a thing, or the word itself when it is unknown."""
    word = " ".join(word.lower().replace("_", " ").split())
    return THING_NAMES.get(word, word)


def color_name(word: str) -> str:
    """Returns the canonical colour, or the word itself when it is unknown."""
    return COLOR_NAMES.get(word.lower(), word.lower())


def class_match(wanted: str, seen: str) -> int:
    """Returns 2 for the same class, 1 where one word is the more general one, else 0."""
    if wanted == seen:
        return 2
    return int(GENERAL.get(seen) == wanted or GENERAL.get(wanted) == seen)


def usual_rooms(thing: str) -> tuple[str, ...]:
    """Returns the kinds of rooms where a class of things is usually found."""
    return tuple(room for room, things in USUAL_ROOMS.items() if thing in things)


def singulars(word: str) -> tuple[str, ...]:
    """Returns the word and what it may be the plural of, likeliest first."""
    forms = [word]
    if word.endswith("ves"):
        forms.append(word[:-3] + "f")
    if word.endswith("ies"):
        forms.append(word[:-3] + "y")
    if word.endswith("es"):
        forms.append(word[:-2])
    if word.endswith("s"):
        forms.append(word[:-1])
    return tuple(forms)
