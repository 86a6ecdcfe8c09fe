"""What the commands share: options, and what they show on a terminal."""

import math
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from guided_lgp.documents import read_json

_LONGEST_S = 1e8
"""Three years: what the operating system's timers can count."""

AsJson = Annotated[
    bool,
    typer.Option("--json", help="Write JSON to standard output.", show_default="text"),
]
ParamsFile = Annotated[
    Path, typer.Option(metavar="FILE", help="YAML file with the parameters of all stages.")
]


def seconds(word: str) -> float:
    """A length of time on the command line.

    Raises:
        BadParameter: it is none.
    """
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not 0.001 <= value <= _LONGEST_S:  # nor is NaN
        raise typer.BadParameter(f"{word!r} is no number of seconds from 0.001 to {_LONGEST_S:g}")
    return value


TimeLimit = Annotated[
    float | None,
    typer.Option(
        "--timeout",
        parser=seconds,
        metavar="SECONDS",
        help="End after so many seconds. The enumeration goes on there the next time, other "
        "stages begin again.",
        show_default="no limit of time",
    ),
]


PlanFile = Annotated[Path, typer.Argument(metavar="PLAN", help="A plan written by plan --out.")]
PlanningTime = Annotated[
    float | None,
    typer.Option(
        "--timeout",
        parser=seconds,
        metavar="SECONDS",
        help="Give up after so many seconds.",
        show_default="no limit of time",
    ),
]
WishedClearance = Annotated[
    float,
    typer.Option(
        "--clearance",
        metavar="M",
        help="Distance that arms, hands and what they carry keep on their way from what they do "
        "not touch, where there is room: from 0.003 to 0.05.",
    ),
]


def one_of(names: Collection[str]) -> Callable[[str], str]:
    """A parser of an option that accepts some names only."""

    def parse(word: str) -> str:
        if word not in names:
            raise typer.BadParameter(f"{word!r} is not one of {', '.join(names)}")
        return word

    return parse


def show(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows: a table on a terminal, lines with tabs in a pipe."""
    if not sys.stdout.isatty():
        for row in rows:
            typer.echo("\t".join(filter(None, row)))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(*columns)
    for row in rows:
        table.add_row(*map(Text, row))
    Console().print(table)


@contextmanager
def spinner(text: str) -> Iterator[None]:
    """Show on a terminal that something is going on."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(text):
        yield


def read_scene_or_plan(file: Path) -> Any:
    """The document in a file, which is read once: there may be nothing to read twice in a pipe.

    Raises:
        InputError: the file is missing or is not JSON.
    """
    return read_json(file, "a scene, or a plan written by plan --out")


def is_plan(document: Any) -> bool:
    """Whether a document is a plan; what is not is left to the reader of scenes."""
    return isinstance(document, dict) and "actions" in document
