"""Faults that pydantic finds in a document, told in words of our own: one line with its field."""

import reprlib
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails

from guided_lgp.errors import InputError

Valid = TypeVar("Valid")

_WORDS: Mapping[str, str] = {
    "missing": "is missing",
    "extra_forbidden": "is an unknown field",
    "float_type": "{value} is not a number",
    "float_parsing": "{value} is not a number",
    "finite_number": "{value} is not a finite number",
    "int_type": "{value} is not a whole number",
    "int_parsing": "{value} is not a whole number",
    "int_parsing_size": "{value} is not a whole number of a sensible size",
    "int_from_float": "{value} is not a whole number",
    "bool_type": "{value} is neither true nor false",
    "string_type": "{value} is not text",
    "string_unicode": "is not text in UTF-8",
    "string_too_short": "{value} has fewer than {min_length} characters",
    "string_too_long": "{value} has more than {max_length} characters",
    "greater_than": "{value} is not greater than {gt}",
    "greater_than_equal": "{value} is less than {ge}",
    "less_than": "{value} is not less than {lt}",
    "less_than_equal": "{value} is more than {le}",
    "literal_error": "{value} is not {expected}",
    "tuple_type": "{value} is not a list",
    "list_type": "{value} is not a list",
    "dict_type": "{value} is not a mapping",
    "model_type": "{value} is not a mapping",
    "too_short": "has {actual_length} values, fewer than {min_length}",
    "too_long": "has {actual_length} values, more than {max_length}",
    "value_error": "{error}",
}
"""By the type of the fault; in braces what its context has, and the value."""


class Document(BaseModel):
    """A part of a document: its own fields and no others."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _known_fields(cls, data: Any) -> Any:
        if isinstance(data, dict):
            refuse_unknown(data, cls.model_fields)
        return data


def refuse_unknown(data: Iterable[str], fields: Iterable[str]) -> None:
    """Suggest the nearest field for one that there is not.

    Raises:
        ValueError: a field of the data is none.
    """
    known = list(fields)
    for field in data:
        if field not in known:
            near = get_close_matches(str(field), known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}"
            raise ValueError(f"unknown field {brief(field)} ({hint})")


def _first_fault(error: ValidationError, where: str, accepted: str, within: str) -> InputError:
    first = error.errors(include_url=False)[0]
    field = ".".join(map(str, (within, *first["loc"]) if within else first["loc"]))
    return InputError(f"{where}: {field}" if field else where, words(first), accepted)


def validated(
    validate: Callable[[Any], Valid],
    document: Any,
    where: str,
    accepted: str = "",
    within: str = "",
) -> Valid:
    """What a document holds: the one way to validate it.

    Args:
        validate: of a pydantic model or type, what validates a Python value.
        document: what was read.
        where: the file, for the message.
        accepted: where such a file comes from.
        within: the field that holds the document.

    Raises:
        InputError: the first fault found, in one line with its field.
    """
    try:
        return validate(document)
    except ValidationError as error:
        raise _first_fault(error, where, accepted, within) from None


def words(fault: ErrorDetails) -> str:
    """What is wrong with a value."""
    phrase = _WORDS.get(fault["type"], "{value} is not accepted")
    context = {
        name: f"{value:.12g}" if isinstance(value, float) else value
        for name, value in fault.get("ctx", {}).items()
    }
    return phrase.format(**context, value=brief(fault["input"]))


def brief(value: object) -> str:
    """The value as text of bounded length: aliases make small files of huge values."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python does not write out integers of more than 4300 digits
        return "a number of thousands of digits"
