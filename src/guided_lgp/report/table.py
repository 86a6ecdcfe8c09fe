"""A table, and how to write it as Markdown, LaTeX (booktabs) and CSV."""

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

Record = Mapping[str, object]

_LATEX = {
    "\\": r"\textbackslash{}",
    **{character: f"\\{character}" for character in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "±": r"$\pm$",
    "–": "--",
    "×": r"$\times$",
    "≥": r"$\geq$",
    "≤": r"$\leq$",
    "μ": r"$\mu$",
    "→": r"$\to$",
}


@dataclass(frozen=True)
class Table:
    """A table for readers (``rows``, formatted) and for programs (``records``, one per figure)."""

    name: str
    """Name of its files."""
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    groups: tuple[tuple[str, int], ...] = ()
    """Headings above the columns, each with the number of columns it spans."""
    labels: int = 1
    """Number of leading columns that hold names rather than figures."""
    records: Sequence[Record] = field(default=())
    """Rows of the CSV file; empty: the formatted rows."""

    def markdown(self) -> str:
        """A table of GitHub's Markdown, title above and notes below."""
        headings = list(self.columns)
        position = 0
        for group, span in self.groups:
            for column in range(position, position + span):
                headings[column] = ": ".join(filter(None, (group, self.columns[column])))
            position += span
        rule = [":---"] * self.labels + ["---:"] * (len(headings) - self.labels)
        lines = [f"**{plain(self.title)}**", ""]
        lines += [f"| {' | '.join(map(plain, row))} |" for row in (headings, rule, *self.rows)]
        for note in self.notes:
            lines += ["", plain(note)]
        return "\n".join(lines) + "\n"

    def latex(self) -> str:
        """A ``table`` environment that needs the packages booktabs and graphicx."""
        alignment = "l" * self.labels + "r" * (len(self.columns) - self.labels)
        lines = [r"\begin{table}", r"\centering", rf"\caption{{{_latex(self.title)}}}"]
        lines += [rf"\label{{tab:{self.name}}}"]
        lines += [r"\resizebox{\linewidth}{!}{%", rf"\begin{{tabular}}{{{alignment}}}", r"\toprule"]
        if self.groups:
            cells, rules, position = [], [], 1
            for group, span in self.groups:
                cells.append(rf"\multicolumn{{{span}}}{{c}}{{{_latex(group)}}}")
                if group:
                    rules.append(rf"\cmidrule(lr){{{position}-{position + span - 1}}}")
                position += span
            lines += [" & ".join(cells) + r" \\", "".join(rules)]
        lines += [" & ".join(map(_latex, self.columns)) + r" \\", r"\midrule"]
        lines += [" & ".join(map(_latex, row)) + r" \\" for row in self.rows]
        lines += [r"\bottomrule", r"\end{tabular}}"]
        lines += [rf"\par\smallskip\footnotesize {_latex(note)}" for note in self.notes]
        return "\n".join([*lines, r"\end{table}"]) + "\n"

    def csv(self) -> str:
        """Comma-separated values with a heading, for ``pandas.read_csv``."""
        stream = io.StringIO()
        if self.records:
            keys = list(dict.fromkeys(key for record in self.records for key in record))
            writer = csv.DictWriter(stream, keys, lineterminator="\n")
            writer.writeheader()
            writer.writerows(self.records)
        else:
            csv.writer(stream, lineterminator="\n").writerows([self.columns, *self.rows])
        return stream.getvalue()


def plain(text: str) -> str:
    """Text that Markdown shows as it is, within tables too."""
    return re.sub(r"([\\|*_<>\[\]`])", r"\\\1", text)


def _latex(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text)
