"""What figures that a stage writes are made of, as later ones read them."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Count = Annotated[int, Field(ge=0, le=10**12)]
Number = Annotated[float, Field(ge=0, le=1e12)]
Share = Annotated[float, Field(ge=0, le=1)]


class Figures(BaseModel):
    """A part of a file of figures: numbers are of their own type; there may be more of them."""

    model_config = ConfigDict(strict=True)
