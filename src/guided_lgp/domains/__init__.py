"""Domains, one file each: types, instructions and goal types. A new file is a new domain."""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from guided_lgp.errors import InputError
from guided_lgp.logic import Domain

PAPER = "pick_and_place"
"""The domain of the paper."""


def domain_names() -> tuple[str, ...]:
    """The names of all domains, sorted."""
    return tuple(sorted(module.name for module in iter_modules(__path__)))


@cache
def extensions(name: str) -> tuple[str, ...]:
    """The domains that extend one, sorted."""
    return tuple(
        other
        for other in domain_names()
        if (base := load_domain(other).extends) is not None and base.name == name
    )


@cache
def load_domain(name: str = PAPER) -> Domain:
    """The domain that the file of this name declares as ``DOMAIN``.

    Raises:
        InputError: there is no such domain, or its file declares what cannot be served.
    """
    if name not in domain_names():
        raise InputError("domain", f"unknown {name!r}", ", ".join(domain_names()))
    domain = getattr(import_module(f"{__name__}.{name}"), "DOMAIN", None)
    if not isinstance(domain, Domain) or domain.name != name:
        accepted = f'DOMAIN = Domain("{name}", ...)'
        raise InputError(f"{name}.py: DOMAIN", "is missing or has another name", accepted)
    return domain
