"""The vocabulary of constraints: one file per term, found by its name.

A term has a kernel (symbolic), the variables that it needs, what a start chooses for them, and a
numeric check that shares no code with the kernel: a function of its file, or for ``clear``,
``apart`` and ``beside`` the overlap of hulls in PyBullet. Instructions declare terms by name.
"""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from guided_lgp.bounds.program.kernels import Kernel, KernelTable
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.terms.term import Term

_NOT_TERMS = ("term",)


@cache
def term_names() -> tuple[str, ...]:
    """All terms, sorted."""
    modules = (module.name for module in iter_modules(__path__))
    return tuple(sorted(name for name in modules if name not in _NOT_TERMS))


@cache
def find_term(name: str) -> Term:
    """The term of a name, which is one of :func:`term_names`."""
    term = import_module(f"{__name__}.{name}").TERM
    assert isinstance(term, Term)
    return term


@cache
def kernel_table(robot: RobotKinematics) -> KernelTable[Kernel]:
    """The kernels of all terms for a robot."""
    return KernelTable([k for name in term_names() for k in find_term(name).kernels(robot)])
