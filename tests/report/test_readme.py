"""The README's results are refreshed in place, and only they."""

from pathlib import Path

import pytest

from guided_lgp.errors import InputError
from guided_lgp.report.readme import BEGIN, END, OPTIONAL, PARTS, update_readme

ROOT = Path(__file__).parents[2]


def test_results_are_replaced_between_the_markers(tmp_path: Path) -> None:
    tables = tmp_path / "reports" / "tables"
    tables.mkdir(parents=True)
    for name in (*PARTS, *OPTIONAL):
        (tables / f"{name}.md").write_text(f"table {name}\n")
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/benchmarks.md").touch()
    readme = tmp_path / "README.md"
    readme.write_text(f"# Title\n\n{BEGIN}\nold\n{END}\n\nThe rest.\n")
    for _ in range(2):
        update_readme(tmp_path)
    text = readme.read_text()
    assert text.startswith(f"# Title\n\n{BEGIN}\n\ntable {PARTS[0]}\n")
    assert text.endswith(f"\n{END}\n\nThe rest.\n")
    assert "old" not in text
    assert "(docs/benchmarks.md)" in text
    assert f"table {PARTS[-1]}\n" in text
    assert text.count(OPTIONAL[-1]) == 1
    readme.write_text("# Title\n")
    with pytest.raises(InputError, match="markers"):
        update_readme(tmp_path)


def test_the_readme_has_the_markers() -> None:
    text = (ROOT / "README.md").read_text()
    assert text.index(BEGIN) < text.index(END)
