"""What the evaluation of a case writes, row by row, and how later stages read it."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, model_validator

from guided_lgp.cases.policies import RIVALS
from guided_lgp.documents import read_json
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.paths import REPORTS
from guided_lgp.quantities import Count, Figures, Number

Row = dict[str, Any]


class _Row(Figures, extra="forbid"):
    scene: str
    planner: str


class _Outcome(_Row):
    """What one planner did on one problem."""

    size: Annotated[int, Field(ge=1)]
    objective: str
    solved: bool
    skeleton: str | None
    length: Count | None
    coarse_calls: Count
    infeasible_calls: Count
    part_calls: Count
    failed_candidates: Count
    path_verified: bool | None
    physics: bool | None

    @model_validator(mode="after")
    def _whole(self) -> "_Outcome":
        if (self.solved or self.path_verified) and None in (self.skeleton, self.length):
            raise ValueError("has a plan without a skeleton or its length")
        if self.part_calls >= self.coarse_calls:
            raise ValueError("has calls on parts of the scene alone")
        return self


class _Time(_Row):
    """How long it took (s)."""

    time_s: Number


_OUTCOMES = TypeAdapter(Annotated[list[_Outcome], Field(min_length=1)])
_TIMES = TypeAdapter(list[_Time])


def outcomes_of(root: Path, case: str, training: str | int) -> Path:
    """The file of the rows of one training of a case, or of :data:`RIVALS`."""
    return root / REPORTS / case / f"{training}.json"


def times_of(root: Path, case: str, training: str | int) -> Path:
    """The file of the times of these rows."""
    return root / REPORTS / case / "times" / f"{training}.json"


def read_outcomes(root: Path, case: str, training: str | int) -> list[Row]:
    """One row per problem and planner.

    Raises:
        InputError: the file is missing or damaged; the message names the command.
    """
    return _read(outcomes_of(root, case, training), _OUTCOMES, _remedy(case, training))


def read_timed(root: Path, case: str, training: str | int) -> list[Row]:
    """The same, each with its time and the training.

    Raises:
        InputError: a file is missing or damaged, or times are of other rows.
    """
    path, remedy = times_of(root, case, training), _remedy(case, training)
    rows, times = read_outcomes(root, case, training), _read(path, _TIMES, remedy)
    if [_key(row) for row in rows] != [_key(time) for time in times]:
        raise InputError(str(path), "is of other rows", remedy)
    return [
        {**row, "training": str(training), "time_s": time["time_s"]}
        for row, time in zip(rows, times, strict=True)
    ]


def _read(path: Path, shape: TypeAdapter[Any], remedy: str) -> list[Row]:
    rows: list[Row] = read_json(path, remedy)
    validated(shape.validate_python, rows, str(path), remedy)
    return rows


def _remedy(case: str, training: str | int) -> str:
    return f"the output of evaluate_case --case {case} --training {training}"


def _key(row: Row) -> tuple[str, str]:
    return row["scene"], row["planner"]


def require_same_problems(rows: list[Row], where: str, wanted: set[tuple[str, str]]) -> None:
    """Refuse rows that cannot be compared.

    Args:
        rows: of all trainings.
        where: their folder, for the message.
        wanted: trainings and planners without which nothing is compared.

    Raises:
        InputError: a planner has not had the problems of the others, or has had one twice; or one
            of those wanted is missing.
    """
    problems: dict[tuple[str, str], list[tuple[int, str]]] = {}
    for row in rows:
        run = problems.setdefault((row["training"], row["planner"]), [])
        run.append((row["size"], row["scene"]))
    first, *others = map(sorted, problems.values())
    rivals = any(training == RIVALS for training, _ in problems)
    same = all(other == first for other in others) and len(set(first)) == len(first)
    if not (same and rivals and wanted <= problems.keys()):
        raise InputError(where, "has planners with other problems than the others", "make cases")
