"""The policies: every package in this folder that declares some.

A new policy is one package with ``DECLARATIONS`` in its ``__init__.py``; nothing else names it.
"""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING

from guided_lgp import policy
from guided_lgp.errors import InputError
from guided_lgp.paths import MODELS
from guided_lgp.policy.declaration import DeclaredPolicy, PolicyDeclaration

if TYPE_CHECKING:
    from guided_lgp.logic import Domain


def _declared() -> Mapping[str, PolicyDeclaration]:
    """Those of all packages, in the order of their names and of their declarations."""
    packages = sorted(found.name for found in iter_modules(policy.__path__) if found.ispkg)
    modules = [import_module(f"{policy.__name__}.{name}") for name in packages]
    declared = [entry for module in modules for entry in module.DECLARATIONS]
    check_policies(declared)
    return {entry.name: entry for entry in declared}


def check_policies(declared: Sequence[PolicyDeclaration]) -> None:
    """Refuse a policy that lacks a part, or has one that is another's.

    Raises:
        InputError: the first fault, with the policy and the part.
    """
    for one in declared:
        _check_parts(one)
        for other in declared:
            if other is not one:
                _check_own(one, other)
    if sum(one.default for one in declared) != 1:
        raise InputError("policies, default", "is not one of them", "one")


def _check_parts(one: PolicyDeclaration) -> None:
    needed = ["name", "label", "summary", "color"]
    needed += ["stage", "networks"] if one.stage or one.networks else []
    for part in needed:
        if not getattr(one, part):
            raise InputError(f"policy {one.name!r}, {part}", "is missing")


def _check_own(one: PolicyDeclaration, other: PolicyDeclaration) -> None:
    for part in ("name", "label", "color"):
        if getattr(one, part) == getattr(other, part):
            raise InputError(f"policy {one.name!r}, {part}", f"is that of {other.name!r}, too")
    if one.folder == other.folder and {*one.networks} & {*other.networks}:
        raise InputError(f"policy {one.name!r}, folder", f"has the files of {other.name!r}, too")


POLICIES = _declared()
"""Every policy by its name, in the order of tables and legends."""

TRAINED_POLICIES = {name: declared for name, declared in POLICIES.items() if declared.stage}
"""Of these, the ones that are trained."""

DEFAULT_POLICY = next(name for name, declared in POLICIES.items() if declared.default)
"""The one for users who do not ask for any."""


def missing_instructions(policy: object, domain: "Domain") -> tuple[str, ...]:
    """The instructions of a domain that a policy cannot score; one that does not say scores all."""
    every = tuple(instruction.name for instruction in domain.instructions)
    known = getattr(policy, "instructions", every)
    return tuple(name for name in every if name not in known)


def load_policy(name: str, directory: Path = MODELS) -> DeclaredPolicy:
    """Read a policy; torch is not needed.

    Args:
        name: one of :data:`POLICIES`.
        directory: the folder ``models`` of a pipeline; the weights of the program by default.

    Raises:
        InputError: there is no policy of that name; or a file is missing, damaged or of another
            version: the message names the stage that makes it.
    """
    if name not in POLICIES:
        raise InputError(f"policy {name!r}", "is unknown", ", ".join(POLICIES))
    return POLICIES[name].load(directory)
