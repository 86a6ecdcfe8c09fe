"""The results that the README quotes."""

from pathlib import Path

from guided_lgp.documents import write_text
from guided_lgp.errors import InputError
from guided_lgp.paths import REPORTS
from guided_lgp.report.benchmarks import PAGE

BEGIN = "<!-- results: written by make repro -->"
END = "<!-- end of results -->"
PARTS = ("findings", "table_1", "table_3_tree_size", "table_3_time")
"""Files of ``reports/tables`` that the README quotes."""
OPTIONAL = ("draws", "geometry")
"""Those that are there once ``make study`` and ``make bench`` have run."""


def readme_block(root: Path) -> str:
    """What the tables say, Tables I and III and the geometry in Markdown, as the README has them.

    Args:
        root: the folder of ``dvc.yaml``.

    Raises:
        InputError: a table is missing.
    """
    texts = []
    for name in (*PARTS, *OPTIONAL):
        path = root / REPORTS / "tables" / f"{name}.md"
        if path.is_file():
            texts.append(path.read_text(encoding="utf-8"))
        elif name not in OPTIONAL:
            raise InputError(str(path), "is missing", "the output of stage render_reports")
    if (root / PAGE).is_file():
        texts.append(f"[Benchmarks]({PAGE}): both bounds, rivals, enumeration, training, memory.\n")
    return "\n".join(texts)


def update_readme(root: Path) -> None:
    """Replace the results between the two markers of ``README.md`` by the current ones.

    Raises:
        InputError: a table or a marker is missing, or the file cannot be written.
    """
    path = root / "README.md"
    text = path.read_text(encoding="utf-8")
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise InputError(str(path), "has no markers of the results", f"{BEGIN} and {END}")
    block = readme_block(root)
    write_text(path, f"{before}{begin}\n\n{block}\n{end}{after}")


if __name__ == "__main__":
    update_readme(Path.cwd())
