"""Compilation of the stage kernels with the solver's loop, once per content.

The content is known by what it is made of: the sources, the arms, and the version of CasADi. So
nothing symbolic has to be built where the library is there already.
"""

import ctypes
import json
from collections.abc import Iterator
from dataclasses import astuple, fields
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import casadi as ca
import numpy as np

from guided_lgp.bounds.program.inverse import INPUTS, closed_forms
from guided_lgp.bounds.program.kernels import Kernel, KernelShape, KernelTable
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.terms import kernel_table
from guided_lgp.cache import made
from guided_lgp.compiled import load_generated
from guided_lgp.robots import Robot

_HERE = Path(__file__).parent
_LOOP = tuple(_HERE / f"{name}.c" for name in ("rows", "cholesky", "solver", "closed_forms"))

_EXTREMES = """
#include <math.h>
static inline double smaller(double a, double b) { return a < b ? a : b; }
static inline double larger(double a, double b) { return a > b ? a : b; }
#define fmin smaller
#define fmax larger
"""
"""Without calls, and without a case for what is not a number: nothing is asked for as often."""


def load_library(robot: Robot) -> ctypes.CDLL | None:
    """The compiled solver of a robot's kernels, or None if it is not there and no compiler works.

    Raises:
        InputError: the cache folder cannot be written.
    """
    return load_generated("coarse", _key(robot), lambda: _source(robot))


@cache
def kernel_shapes(robot: Robot) -> KernelTable[KernelShape]:
    """What programs have to know of a robot's kernels.

    Raises:
        InputError: the cache folder cannot be written.
    """
    file = made(f"kernels-{_key(robot)[:16]}.json", lambda _: _described(robot))
    assert file is not None
    return KernelTable([KernelShape(*row) for row in json.loads(file.read_bytes())])


def _described(robot: Robot) -> bytes:
    names = [field.name for field in fields(KernelShape)]
    table = kernel_table(kinematics_of(robot))
    return json.dumps([[getattr(kernel, name) for name in names] for kernel in table]).encode()


@cache
def _key(robot: Robot) -> str:
    """A digest of all that the code is made of."""
    kinematics = kinematics_of(robot)
    arms = [(a.chain.name, a.side, a.home, a.limits) for a in kinematics.arms.values()]
    lengths = [(c.human_like and astuple(c.human_like)) for c in kinematics.chains]
    chains = [astuple(chain) for chain in kinematics.chains]
    content = (version("casadi"), kinematics.fixed, arms, lengths, chains)
    text = json.dumps(content, default=np.ndarray.tolist)
    return sha256(text.encode() + b"".join(_sources())).hexdigest()


def _sources() -> Iterator[bytes]:
    folders = (_HERE.parent / "program", _HERE.parent / "terms")
    modules = (file for folder in folders for file in sorted(folder.glob("*.py")))
    for file in (*modules, Path(__file__), *_LOOP):
        yield file.read_bytes()


def _source(robot: Robot) -> str:
    """The C code of a robot's kernels, their table, and the loop."""
    kinematics = kinematics_of(robot)
    table, forms = kernel_table(kinematics), closed_forms(kinematics)
    generator = ca.CodeGenerator("kernels", {"casadi_int": "int", "with_header": False})
    functions = [f for kernel in table for f in kernel.compiled]
    for function in (*functions, *forms.values()):
        generator.add(function)
    entries = ", ".join(map(_entry, table))
    macros = {
        "KERNELS": entries,
        "FORMS": ", ".join(form.name() for form in forms.values()) or "0",
        "FORM_INPUTS": INPUTS,
        "LARGEST_INPUT": max(kernel.inputs for kernel in table),
        "LARGEST_ROWS": max(kernel.rows for kernel in table),
        "LARGEST_SHARED": max(1, *(k.shared.values.numel_out() for k in table if k.shared)),
        "WORK": max(1, *(function.sz_w() for function in (*functions, *forms.values()))),
    }
    loop = "\n".join(part.read_text(encoding="utf-8") for part in _LOOP)
    defines = "\n".join(f"#define {name} {value}" for name, value in macros.items())
    return f"{_EXTREMES}{generator.dump()}\n{defines}\n{loop}"


def _entry(kernel: Kernel) -> str:
    """A kernel as the structure in rows.c."""
    shared = kernel.shared
    functions = [function.name() for function in kernel.compiled] + ["0"] * (shared is None)
    sizes = (shared.inputs, shared.parameters) if shared else (0, 0)
    numbers = (kernel.inputs, kernel.parameters, kernel.rows, int(kernel.equality), *sizes)
    return f"{{{', '.join((*functions, *map(str, numbers)))}}}"
