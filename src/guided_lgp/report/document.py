"""The report as headings, paragraphs, tables and pictures, written as Markdown and as HTML."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from guided_lgp.report.table import Table, plain


@dataclass(frozen=True)
class Bullets:
    """A list of sentences."""

    items: Sequence[str]


@dataclass(frozen=True)
class Answers:
    """A list of answers, each by what it is about."""

    items: Mapping[str, str]


@dataclass(frozen=True)
class Picture:
    """A picture in ``figures/``."""

    file: str
    """Its name there, an SVG or PNG file."""
    title: str
    caption: str = ""


@dataclass(frozen=True)
class Gallery:
    """Pictures beside each other."""

    pictures: Sequence[Picture]


@dataclass(frozen=True)
class Links:
    """Links to other files of the report: (address relative to it, text)."""

    items: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Folded:
    """A long table that a page shows on demand."""

    table: Table


_KINDS = {
    "paragraph": str,
    "bullets": Bullets,
    "answers": Answers,
    "table": Table,
    "folded": Folded,
    "picture": Picture,
    "gallery": Gallery,
    "links": Links,
}
"""How the templates call the kinds of blocks."""

Block = str | Bullets | Answers | Table | Folded | Picture | Gallery | Links


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it."""

    title: str
    blocks: Sequence[Block]

    @property
    def anchor(self) -> str:
        """Identifier of the section in the page."""
        return "-".join(self.title.lower().split())


@dataclass(frozen=True)
class Document:
    """The report."""

    title: str
    lead: str
    sections: Sequence[Section]

    def markdown(self) -> str:
        """The report for a forge or an editor; pictures stay in their files."""
        return self._render("report.md.j2", Path())

    def html(self, folder: Path) -> str:
        """One page that needs no other file and no network, links to replays aside.

        Args:
            folder: where ``figures/`` is; the pictures become part of the page.
        """
        return self._render("report.html.j2", folder)

    def _render(self, template: str, folder: Path) -> str:
        environment = Environment(
            loader=PackageLoader("guided_lgp.report"),
            autoescape=template.endswith(".html.j2"),
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
            keep_trailing_newline=True,
        )
        tests: dict[str, Any] = {name: partial(_is, kind) for name, kind in _KINDS.items()}
        environment.tests.update(tests)
        environment.globals["embed"] = lambda file: _embed(folder / "figures" / file)
        environment.filters["plain"] = plain
        return environment.get_template(template).render(document=self)


def _is(kind: type, block: object) -> bool:
    return isinstance(block, kind)


def _embed(path: Path) -> str:
    kind = "image/svg+xml" if path.suffix == ".svg" else "image/png"
    return f"data:{kind};base64,{b64encode(path.read_bytes()).decode()}"
