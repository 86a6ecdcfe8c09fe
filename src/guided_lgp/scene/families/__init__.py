"""Families of random problems, one file each. A new file is a new family; nothing else names it."""

from importlib import import_module
from pkgutil import iter_modules

from guided_lgp.errors import InputError
from guided_lgp.scene.families.family import Drawn, Family, draw_problems

__all__ = ["Drawn", "Family", "draw_problems", "family_names", "find_family"]

_NOT_FAMILIES = ("family",)


def family_names() -> tuple[str, ...]:
    """The names of all families, sorted."""
    modules = (module.name for module in iter_modules(__path__))
    return tuple(sorted(name for name in modules if name not in _NOT_FAMILIES))


def find_family(name: str, where: str = "family") -> Family:
    """The family that the file of this name declares as ``FAMILY``.

    Raises:
        InputError: there is no such family, or its file declares none.
    """
    if name not in family_names():
        raise InputError(where, f"unknown family {name!r}", ", ".join(family_names()))
    family = getattr(import_module(f"{__name__}.{name}"), "FAMILY", None)
    if not isinstance(family, Family) or family.name != name:
        accepted = f'FAMILY = Family("{name}", ...)'
        raise InputError(f"{name}.py: FAMILY", "is missing or has another name", accepted)
    return family
