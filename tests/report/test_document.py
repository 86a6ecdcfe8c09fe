from pathlib import Path

from guided_lgp.report.document import (
    Block,
    Bullets,
    Document,
    Folded,
    Gallery,
    Links,
    Picture,
    Section,
)
from guided_lgp.report.table import Table

NAME = '<img src=x onerror="alert(1)">'


def test_every_kind_of_block_is_written_and_escaped(tmp_path: Path) -> None:
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures/a.svg").write_text("<svg/>", encoding="utf-8")
    table = Table("t", NAME, (NAME, "x"), ((NAME, "1"),), (NAME,), (("", 1), (NAME, 1)))
    blocks: list[Block] = [
        NAME,
        Bullets([NAME]),
        table,
        Folded(table),
        Picture("a.svg", NAME, NAME),
        Gallery([Picture("a.svg", NAME)]),
        Links([("replays/a.html", NAME)]),
    ]
    document = Document(NAME, NAME, [Section(NAME, blocks)])
    page = document.html(tmp_path)
    assert "<img src=x" not in page
    assert page.count("&lt;img src=x") >= 12
    assert page.count('src="data:image/svg+xml;base64,PHN2Zy8+"') == 2
    text = document.markdown()
    assert "<img" not in text.replace(r"\<img", "")
    assert text.count("(figures/a.svg)") == 2
    assert page.count("<details>") == 1
    assert page.count("</table>") == 2
    assert "](replays/a.html)" in text


def test_a_repeated_label_is_shown_once_per_part(tmp_path: Path) -> None:
    rows = (("a.1", "x", "1"), ("a.1", "y", "2"), ("b.1", "x", "3"))
    table = Table("t", "T", ("Problem", "Planner", "n"), rows, labels=2)
    page = Document("D", "", [Section("S", [table])]).html(tmp_path)
    assert page.count("a.1") == 1
    assert page.count('<tr class="part">') == 1
