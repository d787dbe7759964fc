"""From text to tokens: every phrase that the parser knows, longest first."""

from __future__ import annotations

import re
from dataclasses import dataclass

from unilavira_drake.mllm.rules.vocabulary import (
    COLOR_NAMES,
    ROOM_NAMES,
    THING_NAMES,
    singulars,
)


@dataclass(frozen=True)
class Token:
    """A phrase of the text: its part in an instruction and its canonical value."""

    kind: str
    value: str = ""
    text: str = ""


_PHRASES: dict[tuple[str, str], str] = {
    ("leave", ""): "leave|leaving|exit|exiting|depart|quit|out of|vacate",
    ("out", ""): "out|outside",
    ("role", "enter"): "enter|entering|into|in to|onto|right into|inside|back into",
    ("role", "to"): "to|towards|toward|up to|right up to|approach|approaching|reach|reaching|"
    "visit|over to|back to|as far as|all the way to",
    ("role", "find"): "find|finding|locate|look for|looking for|search for|searching for|seek|"
    "hunt for|for",
    ("role", "pass"): "past|pass|passing|beyond|walk by|go by|going by|walking by|move by",
    ("role", "through"): "through|cross|crossing|across|via|traverse|right through",
    ("role", "along"): "along|down|follow|following|the length of",
    ("role", "at"): "at|by|next to|beside|near|close to|nearby|adjacent to|alongside|against|"
    "opposite|in front of|right in front of|right next to|right by|right beside|right at|"
    "within reach of|facing|before reaching|just before",
    ("in", ""): "in|within",
    ("on", ""): "on|to your|to the|on the|on your|to my",
    ("from", ""): "from",
    ("of", ""): "of",
    ("turn", ""): "turn|turning|take|taking|make|making|hang|bear|veer|swing|rotate|pivot",
    ("side", "left"): "left|left hand side|left hand|left side",
    ("side", "right"): "right|right hand side|right hand|right side",
    ("turn_back", ""): "turn around|turn round|turning around|turn back|about face|u turn|"
    "turn yourself around|go back|head back",
    ("straight", ""): "straight|straight ahead|straight on|ahead|forward|forwards|onward|"
    "straight forward|onwards",
    ("stop", ""): "stop|stopping|wait|waiting|halt|stand|stay|pause|park|finish|rest|"
    "come to a stop|come to rest|end up|remain|sit|sit down",
    ("move", ""): "go|going|walk|walking|head|heading|move|moving|drive|driving|proceed|continue|"
    "keep|keep going|travel|advance|step|come|get|navigate|run|roll|return|wander|make your way|"
    "bring me|take me|lead me|guide me|show me",
    ("search", ""): "search|look|explore|hunt|check",
    ("end", ""): "end|far end|other end|very end",
    ("until", ""): "until|till",
    ("when", ""): "when|once|after|as soon as|having",
    ("before", ""): "before",
    ("and", ""): "and|then|and then|next|afterwards|finally|after that|but|while|so|lastly",
    ("hint", ""): "you are|you will see|you see|you should see|you can see|you will find|there is|"
    "there are|there will be|you start|you begin|starting|is|are|you will notice|you will pass|"
    "with|keeping|you are standing|you will be|should be|notice|it is|will be",
    ("see", ""): "see|spot|you spot|you notice",
    ("article", ""): "the|a|an|your|its|my|that|this|some|any|another|other|their|our",
    ("here", ""): "this room|the room|this place|the current room|your room|here|where you are|"
    "room you are in|the room you are in",
    ("next_room", ""): "next room|another room|other room|adjacent room|adjoining room|"
    "neighbouring room|neighboring room|room",
    ("home", ""): "flat|apartment|house|home|building|place|environment|rooms",
    ("it", ""): "it|there|them",
    ("one", ""): "one|ones",
    ("ordinal", "1"): "first|1st|nearest|closest",
    ("ordinal", "2"): "second|2nd",
    ("ordinal", "3"): "third|3rd",
    ("ordinal", "4"): "fourth|4th",
    ("ordinal", "-1"): "last|final",
    ("climb", "up"): "upstairs|up the stairs|up the staircase|up the stairway|up the steps|"
    "climb the stairs|climb the staircase|climb the steps|take the stairs up|take the stairs|"
    "upper floor|upper storey|floor above|next floor up|top floor|one floor up",
    ("climb", "down"): "downstairs|down the stairs|down the staircase|down the stairway|"
    "down the steps|take the stairs down|descend the stairs|descend the staircase|"
    "lower floor|lower storey|floor below|ground floor|one floor down",
    ("thing", "door"): "door|doorway|archway|opening|doors|door frame|entrance door|exit door|"
    "open door",
}

_LEXICON: dict[str, tuple[str, str]] = {
    **{word: ("thing", name) for word, name in THING_NAMES.items()},
    **{word.replace("'", ""): ("room", name) for word, name in ROOM_NAMES.items()},
    **{word: ("color", name) for word, name in COLOR_NAMES.items()},
    **{word: key for key, words in _PHRASES.items() for word in words.split("|")},
}
_LONGEST = max(len(phrase.split()) for phrase in _LEXICON)

_CONTRACTIONS = {"'re": " are", "'ll": " will", "'ve": " have", "it's": "it is", "'d": " would"}
_COURTESY = frozenset(
    [
        "please",
        "now",
        "just",
        "i",
        "you",
        "want",
        "need",
        "would",
        "like",
        "can",
        "could",
        "will",
        "should",
        "must",
        "have",
        "be",
        "been",
        "do",
        "which",
        "who",
        "where",
        "what",
        "very",
        "really",
        "quite",
        "also",
        "too",
        "only",
        "again",
        "all",
        "way",
        "about",
        "slightly",
        "bit",
        "more",
        "further",
        "side",
        "until's",
        "me",
        "robot",
        "hello",
        "hi",
        "thanks",
        "thank",
        "kindly",
        "directly",
        "quickly",
        "carefully",
        "slowly",
        "s",
        "t",
        "m",
        "or",
        "if",
        "up",
        "immediately",
        "simply",
    ]
)


_NEGATED = re.compile(
    r"\b(?:do not|dont|don.t|must not|should not|never|not|avoid|without)\b"
    r"(?:(?!\b(?:but|instead|then)\b)[^.,;:!?])*",
    re.IGNORECASE,
)
"""What is not to be done, to the end of its part of the sentence."""


def words_of(text: str) -> list[str]:
    """Returns lower-case words and sentence marks; hyphens and contractions are opened."""
    text = text.lower().replace("’", "'")
    for short, long in _CONTRACTIONS.items():
        text = text.replace(short, long)
    text = text.replace("'", "").replace("-", " ")
    return re.findall(r"[^\W_]+|[.,;:!?()]", text)


def tokenize(text: str) -> list[Token]:
    """Returns the text as tokens; words outside the lexicon become ``word`` tokens.

    What is not to be done is left out: the plan knows no prohibitions.
    """
    words = words_of(_NEGATED.sub(" ", text))
    tokens: list[Token] = []
    i = 0
    while i < len(words):
        if not words[i][0].isalnum():
            tokens.append(Token("stop_mark" if words[i] in ".;!?" else "comma", "", words[i]))
            i += 1
            continue
        found, length = _match(words, i)
        tokens.append(found)
        i += length
    return _disambiguate(tokens)


def unused_words(text: str) -> tuple[str, ...]:
    """Returns the words of an instruction that the parser cannot use, in order, once each."""
    unknown = (token.text for token in tokenize(text) if token.kind == "word")
    negated = (" ".join(found.split()) for found in _NEGATED.findall(text))
    words = (word for word in unknown if word not in _COURTESY)
    return tuple(dict.fromkeys((*negated, *words)))


def is_courtesy(word: str) -> bool:
    """Whether a word carries nothing in an instruction."""
    return word in _COURTESY


def _match(words: list[str], start: int) -> tuple[Token, int]:
    for length in range(min(_LONGEST, len(words) - start), 0, -1):
        part = words[start : start + length]
        for last in singulars(part[-1]):
            phrase = " ".join((*part[:-1], last))
            if phrase in _LEXICON:
                kind, value = _LEXICON[phrase]
                return Token(kind, value, " ".join(part)), length
    return Token("word", words[start], words[start]), 1


def _disambiguate(tokens: list[Token]) -> list[Token]:
    """Resolves words whose part depends on their neighbours."""
    result: list[Token] = []
    for i, token in enumerate(tokens):
        before = result[-1] if result else Token("stop_mark")
        after = tokens[i + 1] if i + 1 < len(tokens) else Token("stop_mark")
        if token.kind == "on" and token.text.startswith("to") and after.kind != "side":
            # "to the sofa" is a destination, "to the left" a side.
            result += [Token("role", "to", "to"), Token("article", "", token.text[3:])]
        elif token.text.startswith("right ") and token.kind == "role" and before.kind == "turn":
            result += [Token("side", "right", "right"), Token("role", token.value, token.text[6:])]
        elif token.text == "exit" and before.kind in ("article", "ordinal"):
            result.append(Token("thing", "door", token.text))
        elif token.text == "range" and after.kind == "of":
            result.append(Token("word", token.text, token.text))
        elif token.text == "light" and after.kind in ("color", "thing"):
            result.append(Token("article", "", token.text))
        elif token.text == "landing" and before.kind == "move":
            result.append(Token("word", token.text, token.text))
        else:
            result.append(token)
    return result
