"""The glossary has every constraint and every reason that the code may name."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import guided_lgp
from guided_lgp.bounds.terms import term_names
from guided_lgp.search.finding import KINDS
from guided_lgp.search.result import REASONS

SOURCES = Path(guided_lgp.__file__).parent / "bounds"
GLOSSARY = (Path(__file__).parents[1] / "docs" / "glossary.md").read_text(encoding="utf-8")
PLACE = {"Violation": 0, "Failure": 1, "record": 2}
"""Which argument of these calls is the constraint."""


def constraints() -> Iterator[str]:
    """The constant words with which the constraints begin that the bounds may name."""
    for file in sorted(SOURCES.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                name = getattr(node.func, "id", getattr(node.func, "attr", ""))
                if name in PLACE and len(node.args) > PLACE[name]:
                    yield from beginning(node.args[PLACE[name]])


def beginning(argument: ast.expr) -> Iterator[str]:
    if isinstance(argument, ast.JoinedStr):
        argument = argument.values[0]
    if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
        yield argument.value.strip()


def test_the_words_are_found() -> None:
    found = set(constraints())
    assert {"joint limit", "level", "no inverse kinematics", "start", "width of"} <= found


def test_every_constraint_is_explained() -> None:
    spans = re.findall(r"`([^`]+)`", GLOSSARY)
    known = {re.sub(r"( [A-Z]+| …)+$", "", span) for span in spans}  # without what stands for names
    missing = {
        name
        for name in {*constraints(), *term_names()}
        if name not in known and not any(name.startswith(f"{words} ") for words in known)
    }
    assert not missing


def test_every_reason_is_explained() -> None:
    missing = {words for words in {*REASONS.values(), *KINDS.values()} if words not in GLOSSARY}
    assert not missing
