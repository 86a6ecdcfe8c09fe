"""The results that the README quotes."""

from pathlib import Path

from guided_lgp.errors import InputError
from guided_lgp.paths import REPORTS

TABLES = ("table_1", "table_3_tree_size", "table_3_time")


def readme_block(root: Path) -> str:
    """Tables I and III in Markdown, as the README holds them.

    Args:
        root: the folder of ``dvc.yaml``.

    Raises:
        InputError: a table is missing.
    """
    texts = []
    for name in TABLES:
        path = root / REPORTS / "tables" / f"{name}.md"
        if not path.is_file():
            raise InputError(str(path), "is missing", "the output of stage render_reports")
        texts.append(path.read_text(encoding="utf-8"))
    return "\n".join(texts)
