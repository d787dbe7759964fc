"""The parser: instructions in many wordings become the same few clauses."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.mllm.rules.clauses import Clause, describe
from unilavira_drake.mllm.rules.lexicon import unused_words
from unilavira_drake.mllm.rules.parser import parse
from unilavira_drake.mllm.rules.vocabulary import COLORS, ROOMS, THINGS


def said(text):
    return [describe(clause) for clause in parse(text)]


@pytest.mark.parametrize(
    ("text", "plan"),
    [
        (
            "Walk out of the office, turn left at the end of the hall and go to the fridge in the "
            "kitchen.",
            ["Leave the study", "Go to the end of the corridor", "Turn left", "Enter the kitchen",
             "Go to the refrigerator"],
        ),
        (
            "Head down the hallway until you see the red bench, then turn right into the lounge.",
            ["Walk along the corridor", "Go on until you spot the red bench", "Turn right",
             "Enter the living room"],
        ),
        (
            "Turn right, walk past the bench and the lamp, and enter the first door on your right.",
            ["Turn right", "Go past the bench", "Go past the lamp",
             "Go through the first door on the right"],
        ),
        (
            "Enter the living room. There are two couches: stop in front of the blue one.",
            ["Enter the living room", "Stop next to the blue sofa"],
        ),
        ("Go to the TV monitor in the lounge.", ["Enter the living room", "Go to the television"]),
        ("There is a door on your left. Go through it.", ["Go through the door on the left"]),
        ("Before entering the kitchen, turn left.", ["Turn left", "Enter the kitchen"]),
        ("Get out of here, and wait by the plant.", ["Leave this room", "Stop next to the plant"]),
        ("Could you find me the grey washer?", ["Go to the gray washing machine"]),
        (
            "Go back to the hallway and go to the lamp at the end of the corridor.",
            ["Turn around", "Enter the corridor", "Go to the end of the corridor",
             "Go to the lamp"],
        ),
        (
            "Leave the room through the door on the right and stop at the bench.",
            ["Leave this room through the door on the right", "Stop next to the bench"],
        ),
        (
            "You are in the lounge. Inside the study you will see a violet sofa. Go to the couch.",
            ["Go to the purple sofa"],
        ),
        ("Go to the sofa next to the lamp.", ["Go to the sofa near the lamp"]),
        ("Make a left, then go into the second room on the right.",
         ["Turn left", "Go through the second door on the right"]),
        ("Proceed along the passage; the kitchen will be on your right.",
         ["Walk along the corridor"]),
        ("Move toward the purple bin near the kitchen door.", ["Go to the purple trash can"]),
        ("washing machine", ["Go to the washing machine"]),
        ("Find the theremin.", ["Go to the theremin"]),
        ("Walk straight ahead.", ["Go straight ahead"]),
        ("Go to the bookshelves.", ["Go to the bookshelf"]),
        ("Don't dawdle.", []),
    ],
)  # fmt: skip
def test_wordings(text, plan):
    assert said(text) == plan


def test_words_that_nothing_uses_are_told():
    assert unused_words("Please sing loudly and go to the sofa near the gramophone.") == (
        "sing",
        "loudly",
        "gramophone",
    )


def test_letter_case_hyphens_and_spaces_do_not_matter():
    assert parse("TAKE the  left-hand DOOR") == parse("take the left hand door")


side = st.sampled_from(["", "left", "right"])
color = st.sampled_from(["", *COLORS])
thing = st.sampled_from(sorted(THINGS))
room = st.sampled_from(sorted(ROOMS))
ordinal = st.sampled_from([0, 1, 2, 3, -1])
clause = st.one_of(
    st.builds(Clause, st.just("leave"), room=room),
    st.builds(Clause, st.just("enter"), room=room, side=side),
    st.builds(Clause, st.sampled_from(["through", "along", "end", "near_door"]), room=room),
    st.builds(Clause, st.just("door"), side=side, ordinal=ordinal),
    st.builds(Clause, st.just("turn"), side=st.sampled_from(["left", "right", "around"])),
    st.builds(Clause, st.sampled_from(["go", "stop", "pass", "see"]), thing, color),
    st.builds(Clause, st.sampled_from(["go", "stop"]), thing, color, side=side, ordinal=ordinal),
)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(clause)
def test_a_todo_item_is_read_back_as_the_clause_it_was_made_from(clause):
    assert parse(describe(clause)) == (clause,)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.text(max_size=60))
def test_no_text_breaks_the_parser(text):
    for clause in parse(text):
        assert describe(clause)
    unused_words(text)
