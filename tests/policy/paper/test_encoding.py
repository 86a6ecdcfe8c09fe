import numpy as np
import pytest

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import Action, State, Symbols, parse_objective
from guided_lgp.policy.paper.encoding import NOWHERE, Encoding

ENCODING = Encoding()
FIVE_BOXES = Encoding(slots=(("gripper", 2), ("box", 5), ("table", 2)))
ON_TABLES = load_domain().state({"red": "tab1", "green": "tab1", "blue": "tab2"})
MANY = load_domain().symbols(
    gripper=("pr2L", "pr2R"),
    box=("red", "green", "blue", "pink", "grey"),
    table=("tab1", "tab2", "tray"),
)
ON_TAB1 = load_domain().state(dict.fromkeys(MANY.boxes, "tab1"))


def test_sizes() -> None:
    assert (ENCODING.goal_size, ENCODING.state_size, ENCODING.input_size) == (10, 21, 41)
    assert len(ENCODING.input_names) == len(set(ENCODING.input_names)) == 41
    assert ENCODING.chains == {
        "instruction": ("instruction",),
        "grasp": ("gripper", "box"),
        "place": ("gripper", "box", "table"),
    }
    sizes = [ENCODING.chain_inputs(network) for network in ENCODING.chains]
    assert sizes == [[41], [41, 43], [41, 43, 46]]


def test_another_instruction_is_another_network() -> None:
    """A hand-over adds a network, and a parameter that only it decides about."""
    encoding = Encoding(domain="handover")
    assert encoding.chains == {**ENCODING.chains, "take": ("gripper", "giver", "box")}
    assert encoding.signature.decisions == ("instruction", "gripper", "box", "table", "giver")
    assert encoding.input_names == ENCODING.input_names
    assert encoding.chain_inputs("take") == [41, 43, 45]
    symbols = load_domain("handover").symbols(
        gripper=MANY.grippers, box=MANY.boxes[:3], table=MANY.surfaces[:2]
    )
    slots = encoding.fill((), ON_TABLES, symbols)
    actions = ["(take pr2R pr2L green)", "(grasp pr2L blue)"]
    classes = encoding.encode_actions(slots, map(Action.parse, actions))
    assert classes == [(2, 1, 1, -1, 0), (0, 0, 2, -1, -1)]
    assert Encoding.parse(encoding.document(), "x.json", "train_policy") == encoding


@pytest.mark.parametrize(
    ("goals", "expected"),
    [
        #                held on | red green blue | tab1 tab2 red green blue
        (["(on red tab2)", "(held blue)"], "01 100 01000  10 001 00000"),
        (["(held blue)", "(on red tab2)"], "10 001 00000  01 100 01000"),
        (["(on green red)", "(on blue green)"], "01 010 00100  01 001 00010"),
        (["(on green blue)"], "01 010 00001  01 010 00001"),
        (["(held red)"], "10 100 00000  10 100 00000"),
    ],
)
def test_goals_by_hand(symbols: Symbols, goals: list[str], expected: str) -> None:
    slots = ENCODING.fill(parse_objective(goals), ON_TABLES, symbols)
    code = ENCODING.encode_goals(slots, ON_TABLES)
    assert code.tolist() == [float(digit) for digit in expected.replace(" ", "")]


def test_state_is_the_position_of_every_symbol_in_order(symbols: Symbols) -> None:
    names = ("pr2L", "pr2R", "red", "green", "blue", "tab1", "tab2")
    positions = {name: np.array([i, i + 0.25, i + 0.5]) for i, name in enumerate(names)}
    shuffled = {name: positions[name] for name in sorted(names)}
    code = ENCODING.encode_state(ENCODING.fill((), ON_TABLES, symbols), ON_TABLES, shuffled)
    assert code.dtype == np.float32
    assert code.tolist() == [
        *(0, 0.25, 0.5, 1, 1.25, 1.5),
        *(2, 2.25, 2.5, 3, 3.25, 3.5, 4, 4.25, 4.5),
        *(5, 5.25, 5.5, 6, 6.25, 6.5),
    ]


@pytest.mark.parametrize(
    ("action", "classes"),
    [
        ("(grasp pr2L green)", (0, 0, 1, -1)),
        ("(grasp pr2R red)", (0, 1, 0, -1)),
        ("(place pr2R blue tab1)", (1, 1, 2, 0)),
        ("(place pr2L red tab2)", (1, 0, 0, 1)),
        ("(place pr2L green blue)", (1, 0, 1, 4)),
    ],
)
def test_actions_by_hand(symbols: Symbols, action: str, classes: tuple[int, ...]) -> None:
    slots = ENCODING.fill((), ON_TABLES, symbols)
    assert ENCODING.encode_actions(slots, [Action.parse(action)]) == [classes]


def test_what_fits_stays_as_it_is(symbols: Symbols) -> None:
    state = load_domain().state({"red": "tab1", "green": "tab1"}, {"blue": "pr2R"})
    objective = parse_objective(["(on blue green)", "(on green tab2)"])
    slots = ENCODING.fill(objective, state, symbols)
    assert slots.goals == objective
    assert slots.symbols == (*symbols.grippers, *symbols.boxes, *symbols.surfaces)


def test_of_many_goals_two_unsatisfied_ones_supports_first() -> None:
    objective = parse_objective(
        ["(on red green)", "(on green blue)", "(on blue tray)", "(on pink tab1)"]
    )
    slots = ENCODING.fill(objective, ON_TAB1, MANY)
    assert slots.goals == parse_objective(["(on blue tray)", "(on green blue)"])
    assert slots.of(["box"]) == ("blue", "green", "red")

    later = load_domain().state({**dict(ON_TAB1.support), "blue": "tray", "green": "blue"})
    assert ENCODING.fill(objective, later, MANY).goals == parse_objective(["(on red green)"])


def test_goals_that_name_more_than_three_boxes_become_one_goal() -> None:
    objective = parse_objective(["(on red green)", "(on blue pink)"])
    assert ENCODING.fill(objective, ON_TAB1, MANY).goals == objective[:1]
    later = load_domain().state({**dict(ON_TAB1.support), "red": "green"})
    assert ENCODING.fill(objective, later, MANY).goals == objective[1:]


def test_boxes_of_the_goals_then_held_ones_then_others() -> None:
    state = load_domain().state(
        {"red": "tab1", "green": "tab1", "blue": "tab1", "pink": "tab1"}, {"grey": "pr2L"}
    )
    objective = parse_objective(["(on pink tray)"])
    slots = ENCODING.fill(objective, state, MANY)
    assert slots.of(["box"]) == ("pink", "grey", "red")
    actions = ["(grasp pr2R green)", "(place pr2L grey green)", "(place pr2L grey pink)"]
    classes = ENCODING.encode_actions(slots, map(Action.parse, actions))
    assert classes == [None, None, (1, 0, 1, 2)]


@pytest.mark.parametrize(
    ("goals", "surfaces"),
    [
        (["(on red tray)", "(on green tab2)"], ("tray", "tab2")),
        (["(on red tray)", "(on green red)"], ("tab1", "tray")),
        (["(on red tab2)"], ("tab1", "tab2")),
        (["(held red)"], ("tab1", "tab2")),
    ],
)
def test_tables_of_the_goals_first(goals: list[str], surfaces: tuple[str, ...]) -> None:
    assert ENCODING.fill(parse_objective(goals), ON_TAB1, MANY).of(["table"]) == surfaces


def test_slots_without_a_symbol_are_empty_and_zero() -> None:
    symbols = load_domain().symbols(gripper=("pr2L", "pr2R"), box=("red",), table=("tab1",))
    state = load_domain().state({"red": "tab1"})
    slots = ENCODING.fill(parse_objective(["(held red)"]), state, symbols)
    assert slots.symbols == ("pr2L", "pr2R", "red", None, None, "tab1", None)
    positions = {name: np.ones(3) for name in ("pr2L", "pr2R", "red", "tab1")}
    code = ENCODING.encode_state(slots, ON_TABLES, positions).reshape(7, 3)
    assert code.tolist() == [[float(name is not None)] * 3 for name in slots.symbols]


def test_normalised_positions_by_hand() -> None:
    symbols = load_domain().symbols(
        gripper=("pr2L", "pr2R"), box=("red", "green"), table=("tab1", "tab2")
    )
    encoding = Encoding(centre=(0.5, 0.0, 1.0) * 7, scale=(2.0, 1.0, 0.5) * 7)
    slots = encoding.fill((), load_domain().state({"red": "tab1", "green": "tab1"}), symbols)
    positions = {name: np.array([2.5, 1.0, 0.0]) for name in slots.symbols if name}
    code = encoding.encode_state(slots, ON_TABLES, positions).reshape(7, 3)
    assert code[[0, 1, 2, 3, 5, 6]].tolist() == [[1, 1, -2]] * 6
    assert code[4].tolist() == [0, 0, 0]


def test_without_chain_every_sub_policy_has_the_input_alone() -> None:
    assert Encoding(chain=False).chain_inputs("place") == [41, 41, 41]


def test_document_comes_back() -> None:
    normalised = Encoding(centre=(0.1,) * 21, scale=(0.7,) * 21)
    for encoding in (ENCODING, FIVE_BOXES, Encoding(chain=False), normalised):
        assert Encoding.parse(encoding.document(), "x.json", "train_policy") == encoding


@pytest.mark.parametrize(
    "change",
    [
        {"version": 0},
        {"slots": {"boxes": 4}},
        {"slots": {"legs": 2}},
        {"slots": 3},
        {"inputs": []},
        {"normalisation": {"centre": [0.1], "scale": [0.7]}},
        {"normalisation": {"centre": [], "scale": [0.7] * 21}},
    ],
)
def test_documents_of_another_encoding_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(InputError, match=r"x\.json: encoding.*train_policy"):
        Encoding.parse(ENCODING.document() | change, "x.json", "train_policy")


def test_something_else_is_refused() -> None:
    with pytest.raises(InputError, match=r"x\.json: encoding.*train_policy"):
        Encoding.parse([1], "x.json", "train_policy")


def test_named_boxes_fill_the_first_slots(symbols: Symbols) -> None:
    encoding = Encoding(named_first=True)

    def boxes(*goals: str, state: State = ON_TAB1) -> tuple[str | None, ...]:
        return encoding.fill(parse_objective(goals), state, MANY).of(["box"])

    assert boxes("(on blue grey)") == ("blue", "grey", "red")
    assert boxes("(held grey)", "(on green tray)") == ("grey", "green", "red")
    held = load_domain().state(
        {box: "tab1" for box in MANY.boxes if box != "pink"}, {"pink": "pr2L"}
    )
    assert boxes("(on blue tab2)", state=held) == ("blue", "pink", "red")
    fewer = load_domain().symbols(
        gripper=symbols.grippers, box=("red", "green"), table=symbols.surfaces
    )
    slots = encoding.fill(parse_objective(["(held green)"]), ON_TABLES, fewer)
    assert slots.of(["box"]) == ("green", "red", None)


def test_what_the_state_means_by_hand(symbols: Symbols) -> None:
    encoding = Encoding(symbolic_state=True)
    state = load_domain().state({"red": "tray", "green": "red"}, {"blue": "pr2R"})
    three = load_domain().symbols(gripper=MANY.grippers, box=MANY.boxes[:3], table=MANY.surfaces)
    slots = encoding.fill(parse_objective(["(held blue)", "(on red tab1)"]), state, three)
    assert encoding.encode_supports(slots, state) == (NOWHERE, 2, -2), "the tray has no slot"
    positions = dict.fromkeys((*MANY.grippers, *MANY.boxes, *MANY.surfaces), np.zeros(3))
    code = encoding.encode_state(slots, state, positions)
    assert not code[:21].any()
    #                              tab1 tab2 red green blue | pr2L pr2R
    expected = "00000 00" + "00100 00" + "00000 01"
    assert code[21:].tolist() == [float(digit) for digit in expected.replace(" ", "")]
    assert encoding.encode_goals(slots, state)[[10, 21]].tolist() == [1, 0]
