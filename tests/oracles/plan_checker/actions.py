"""Actions: legal, told by the attachments, and what they achieve."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from plan_checker.document import (
    EDGE,
    NEAR,
    ROUNDING,
    SAME_ANGLE,
    TURNED,
    Attachment,
    Fault,
    Motion,
    Plan,
    body_vertices,
    scene_pose,
)
from plan_checker.geometry import face_of, placed_points

UPRIGHT = 0.05  # tilt (rad) up to which a box is upright on its way


@dataclass
class State:
    """Who holds what, and what stands on what."""

    support: dict[str, str]  # of every box that is not held
    holds: dict[str, str]  # gripper: box

    def chain(self, item: str) -> list[str]:
        """The item, what it stands on, and so on down."""
        down = [item]
        while down[-1] in self.support:
            down.append(self.support[down[-1]])
        return down

    def carrier(self, box: str) -> str | None:
        """The gripper that moves the box, directly or through the boxes below it."""
        root = self.chain(box)[-1]
        return next((gripper for gripper, held in self.holds.items() if held == root), None)

    def carried(self, item: str) -> list[str]:
        """The boxes that stand on the item, directly or through others."""
        return [box for box in self.support if item in self.chain(box)[1:]]

    def apply(self, action: tuple[str, ...]) -> None:
        match action:
            case "grasp", gripper, box:
                self.holds[gripper] = box
                del self.support[box]
            case "take", gripper, giver, box:
                self.holds[gripper] = self.holds.pop(giver)
            case "place", gripper, box, table:
                del self.holds[gripper]
                self.support[box] = table


def state_at_start(plan: Plan) -> State:
    holds = {box["on"]: name for name, box in plan.boxes.items() if box["on"] in plan.hands}
    stands = {name: box["on"] for name, box in plan.boxes.items() if name not in holds.values()}
    return State(stands, holds)


def illegal_actions(plan: Plan) -> Iterator[Fault]:
    state = state_at_start(plan)
    for action in plan.actions:
        why = _illegal(plan, state, action)
        if why:
            yield Fault("logic", None, f"{_text(action)}: {why}")
            return
        state.apply(action)


def _illegal(plan: Plan, state: State, action: tuple[str, ...]) -> str:
    """Why an action is not allowed in a state; empty if it is."""
    kind, gripper, *others = action
    box = others[-1] if kind == "take" else others[0]
    givers = others[:-1] if kind == "take" else []
    table = others[1] if kind == "place" else None
    if not {gripper, *givers} <= plan.hands.keys() or box not in plan.boxes:
        return "a name is not in the scene"
    if table is not None and table not in plan.boxes.keys() | plan.tables.keys():
        return "a name is not in the scene"
    if table is None and gripper in state.holds:
        return f"{gripper} is not free"
    if kind == "grasp" and box in state.holds.values():
        return f"{box} is held already"
    if any(state.holds.get(giver) != box for giver in givers):
        return f"{givers[0]} does not hold {box}"
    if givers and state.carried(box):
        return f"{box} carries others"
    if table is not None and state.holds.get(gripper) != box:
        return f"{gripper} does not hold {box}"
    if table is not None and box in state.chain(table):
        return f"{table} stands on {box}"
    return ""


def _text(words: Sequence[str]) -> str:
    return f"({' '.join(words)})"


class UnmatchedError(Exception):
    def __init__(self, fault: Fault) -> None:
        super().__init__(fault.text)
        self.fault = fault


@dataclass(frozen=True)
class Event:
    """An action takes effect at a row: a gripper takes hold of a box, another lets go of it."""

    action: tuple[str, ...]
    row: int
    taken: Attachment | None
    released: Attachment | None


def _in_hands(plan: Plan) -> list[Attachment]:
    """Of the boxes that are in a hand at the start."""
    holds = state_at_start(plan).holds
    return [a for a in plan.attachments if a.start == 0 and holds.get(a.gripper) == a.box]


def attachments_taken(plan: Plan, events: Sequence[Event]) -> list[Attachment]:
    """Of the boxes that grippers hold, from the start or since an action."""
    return [*_in_hands(plan), *(event.taken for event in events if event.taken is not None)]


def switch_events(plan: Plan) -> list[Event]:
    """When each action takes effect, in the order of the actions.

    A grasp or take begins the first attachment of its pair from then on; the next place of its
    gripper, or take from it, ends it. Other attachments must belong to boxes that ride on a held
    one.
    """
    events: list[Event] = []
    held = {attachment.gripper: attachment for attachment in _in_hands(plan)}
    now, last = 0, len(plan.times) - 1
    for action in plan.actions:
        kind, gripper, *others = action
        box, taken, released = others[-1] if kind == "take" else others[0], None, None
        if kind == "place":
            released = held.pop(gripper)
            row = released.end
            if row < now:
                text = f"{_text(action)}: takes effect before the action before it"
                raise UnmatchedError(Fault("order", row, text))
        else:
            mine = [a for a in plan.attachments if a[:2] == (box, gripper)]
            later = [a for a in mine if a.start >= now]
            if not later:
                text = f"{_text(action)}: no attachment from row {now} on"
                raise UnmatchedError(Fault("order" if mine else "attachment", now, text))
            held[gripper] = taken = later[0]
            row = taken.start
            if kind == "take":
                released = held.pop(others[0])
                if released.end != row:
                    text = f"{_text(action)}: {others[0]} lets go at row {released.end}"
                    raise UnmatchedError(Fault("attachment", row, text))
        events.append(Event(action, row, taken, released))
        now = row
    for gripper, attachment in held.items():
        if attachment.end != last:
            text = f"{attachment.box} leaves {gripper} without being placed"
            raise UnmatchedError(Fault("attachment", attachment.end, text))
    return events


def states_after(plan: Plan, events: Sequence[Event]) -> list[State]:
    """The state from every row on."""
    state, states = state_at_start(plan), []
    pending = list(events)
    for row in range(len(plan.times)):
        while pending and pending[0].row <= row:
            state = State(dict(state.support), dict(state.holds))
            state.apply(pending.pop(0).action)
        states.append(state)
    return states


def wrong_carriers(plan: Plan, events: Sequence[Event]) -> Iterator[Fault]:
    """What the gripper carries by the actions, and nothing else, is rigid in it."""
    states = states_after(plan, events)[:-1]
    for box in plan.boxes:
        for interval, state in enumerate(states):
            told = [a.gripper for a in plan.attachments if a.box == box and _spans(a, interval)]
            expected = [gripper for gripper in [state.carrier(box)] if gripper]
            if told != expected:
                text = f"{box} is rigid in {told or 'nothing'}, by the actions in {expected}"
                yield Fault("attachment", interval, text)
                break


def _spans(attachment: Attachment, interval: int) -> bool:
    return attachment.start <= interval < attachment.end


def missed_goals(plan: Plan, events: Sequence[Event], motion: Motion) -> Iterator[Fault]:
    state = state_at_start(plan)
    for event in events:
        state.apply(event.action)
    for goal in plan.goals:
        if not _achieved(plan, state, motion, goal):
            yield Fault("goal", len(plan.times) - 1, f"{_text(goal)} does not hold at the end")


def _achieved(plan: Plan, state: State, motion: Motion, goal: tuple[str, ...]) -> bool:
    match goal:
        case "held", box:
            return box in state.holds.values()
        case "on", box, table:
            return state.support.get(box) == table
        case "heldby", box, gripper:
            return state.holds.get(gripper) == box
        case "empty", gripper:
            return gripper in plan.hands and gripper not in state.holds
        case ("handempty",):
            return not state.holds
        case "at", box, table, *numbers:
            there = _is_at(motion.boxes[box][-1], [float(number) for number in numbers])
            return state.support.get(box) == table and there
        case "in", box, table, *numbers:
            inside = _is_in(plan, motion, box, table, [float(number) for number in numbers])
            return state.support.get(box) == table and inside
        case "upright", box:  # at rest it is level anyway, so that all of the way counts
            return box in motion.boxes and _stays_level(plan, motion, box)
        case "posture", gripper, *numbers:
            return gripper in plan.hands and _ends_at(plan, gripper, list(map(float, numbers)))
    return False


def _ends_at(plan: Plan, gripper: str, values: list[float]) -> bool:
    joints = plan.hands[gripper].joints
    last = [plan.q[-1][plan.joints.index(joint)] for joint in joints]
    return len(values) == len(last) and np.allclose(last, values, rtol=0, atol=ROUNDING)


def _is_at(pose: np.ndarray, numbers: list[float]) -> bool:
    x, y, z, yaw, near, turned = [*numbers, *(NEAR, TURNED)[len(numbers) - 4 :]]
    turn = Rotation.from_matrix(pose[:3, :3]) * Rotation.from_euler("z", -yaw)
    way = float(np.linalg.norm(pose[:3, 3] - (x, y, z)))
    return way <= near + 1e-6 and turn.magnitude() <= turned + SAME_ANGLE


def _is_in(plan: Plan, motion: Motion, box: str, table: str, region: list[float]) -> bool:
    frame = motion.boxes[table][-1] if table in plan.boxes else scene_pose(plan, table)
    base = face_of(body_vertices(plan.boxes[box]), -1)
    corners = placed_points(motion.boxes[box][-1:], base)[0, :3].T
    local = (corners - frame[:3, 3]) @ frame[:3, :3]
    low, high = np.array(region[:2]) - EDGE, np.array(region[2:]) + EDGE
    return bool(((local[:, :2] >= low) & (local[:, :2] <= high)).all())


def _stays_level(plan: Plan, motion: Motion, box: str) -> bool:
    corners = placed_points(motion.boxes[box], face_of(body_vertices(plan.boxes[box]), -1))
    width = float(np.linalg.norm(plan.boxes[box]["size"][:2]))
    return bool((np.ptp(corners[:, 2], axis=1) <= UPRIGHT * width).all())
