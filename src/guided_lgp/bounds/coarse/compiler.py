"""Compilation of the stage kernels with the solver's loop, once per content."""

import ctypes
from pathlib import Path

import casadi as ca

from guided_lgp.bounds.program.inverse import INPUTS, closed_forms
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.terms import kernel_table
from guided_lgp.compiled import load_compiled
from guided_lgp.robots import Robot


def _source(robot: Robot) -> str:
    """The C code of a robot's kernels, their table, and the loop."""
    kinematics = kinematics_of(robot)
    table, forms = kernel_table(kinematics), closed_forms(kinematics)
    generator = ca.CodeGenerator("kernels", {"casadi_int": "int", "with_header": False})
    functions = [f for kernel in table for f in (kernel.residual, kernel.jacobian)]
    for function in (*functions, *forms.values()):
        generator.add(function)
    entries = ", ".join(
        f"{{{k.name}_residual, {k.name}_jacobian, {k.inputs}, {k.rows}, {int(k.equality)}}}"
        for k in table
    )
    macros = {
        "KERNELS": entries,
        "REACHES": ", ".join(form.name() for form in forms.values()) or "0",
        "REACH_INPUTS": INPUTS,
        "LARGEST_INPUT": max(kernel.inputs for kernel in table),
        "LARGEST_ROWS": max(kernel.rows for kernel in table),
        "WORK": max(1, *(function.sz_w() for function in (*functions, *forms.values()))),
    }
    parts = (Path(__file__).with_name(name) for name in ("cholesky.c", "solver.c"))
    loop = "\n".join(part.read_text(encoding="utf-8") for part in parts)
    defines = "\n".join(f"#define {name} {value}" for name, value in macros.items())
    return f"{generator.dump()}\n{defines}\n{loop}"


def load_library(robot: Robot) -> ctypes.CDLL | None:
    """The compiled solver of a robot's kernels, or None if it is not there and no compiler works.

    Raises:
        InputError: the cache folder cannot be written.
    """
    return load_compiled("coarse", _source(robot))
