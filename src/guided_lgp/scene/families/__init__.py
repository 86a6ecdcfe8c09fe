"""Families of random problems: every module of this folder that declares a ``FAMILY``.

A new family is one file; nothing else names it.
"""

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules

from guided_lgp.errors import InputError
from guided_lgp.scene.families.family import Drawn, Family, draw_problems

__all__ = ["FAMILIES", "Drawn", "Family", "draw_problems", "find_family"]


def _declared() -> Mapping[str, Family]:
    modules = [import_module(f"{__name__}.{found.name}") for found in iter_modules(__path__)]
    families = [getattr(module, "FAMILY", None) for module in modules]
    return {family.name: family for family in families if family is not None}


FAMILIES = _declared()
"""Every family by its name."""


def find_family(name: str, where: str = "family") -> Family:
    """A family by its name.

    Raises:
        InputError: there is none of that name.
    """
    if name not in FAMILIES:
        raise InputError(where, f"unknown family {name!r}", ", ".join(FAMILIES))
    return FAMILIES[name]
