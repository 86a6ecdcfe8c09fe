"""What the JSON files of the paper's policy hold: encodings and data sets."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from guided_lgp.domains import PAPER

_IN_FILES = {"gripper": "grippers", "box": "boxes", "table": "surfaces"}
"""What files call the slots of a type, where it is not its name."""


def in_files(kind: str) -> str:
    """What files call the own symbols of a logic type."""
    return _IN_FILES.get(kind, kind)


class EncodingDocument(BaseModel):
    """An encoding."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

    class Normalisation(BaseModel):
        """Shift and scale of every coordinate."""

        model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

        centre: list[float]
        scale: list[Annotated[float, Field(gt=0)]]

    version: Literal[1]
    domain: str = PAPER
    slots: dict[str, Annotated[int, Field(ge=1, le=100)]]
    chain: bool
    named_first: bool
    relative: bool
    meaning: bool
    normalisation: Normalisation
    inputs: list[str]


class NetworkDocument(BaseModel):
    """What the weights of a network mean."""

    model_config = ConfigDict(strict=True, extra="forbid")

    version: Literal[1]
    network: str
    sub_policies: dict[str, Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=2)]]
    """By name: the widths of its layers, from the inputs to the classes."""
    activation: Literal["relu"]
    training: dict[str, Any]
    encoding: Any


class DatasetDocument(BaseModel):
    """What the samples mean; the names of the symbols have the keys of their types."""

    model_config = ConfigDict(strict=True, extra="allow")
    __pydantic_extra__: dict[str, list[str]] = Field(init=False)

    version: Literal[1]
    samples: int
    digest: str
    """SHA-256 of the samples' file."""
    objectives: list[list[str]]
    configurations: list[str]
    encoding: Any
