"""What facts say of a goal that cannot be reached."""

from dataclasses import dataclass
from typing import Literal

Kind = Literal["width", "reach", "room", "way", "blocked", "part", "posture", "tilted"]

KINDS: dict[Kind, str] = {
    "width": "too wide for the fingers",
    "reach": "out of reach",
    "room": "no room",
    "way": "no arm for the whole way",
    "blocked": "neighbours in the way",
    "part": "no solution even alone",
    "posture": "no motion found to the posture",
    "tilted": "tilted at the start",
}
"""What may be found, in the words of the glossary."""


@dataclass(frozen=True)
class Finding:
    """Why a goal cannot be reached, and what would help."""

    kind: Kind
    text: str
    help: str

    def document(self) -> dict[str, str]:
        """The JSON document."""
        return vars(self)
