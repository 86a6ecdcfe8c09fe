import io

import pandas as pd

from guided_lgp.report.table import Table

TABLE = Table(
    "example",
    "Shares & more",
    ("Name", "paper", "ours"),
    (("a_1", "91.9%", "2 ± 1"), ("<b>|x", "–", "3")),
    ("A note on 5%.",),
    (("", 1), ("Guided", 2)),
)


def test_markdown_escapes_names_and_names_the_group_of_a_column() -> None:
    lines = TABLE.markdown().splitlines()
    assert lines[2] == "| Name | Guided: paper | Guided: ours |"
    assert lines[5] == r"| \<b\>\|x | – | 3 |"
    assert lines[-1] == "A note on 5%."


def test_latex_is_booktabs_with_escaped_text() -> None:
    text = TABLE.latex()
    assert r"\caption{Shares \& more}" in text
    assert r" & \multicolumn{2}{c}{Guided} \\" in text
    assert r"\cmidrule(lr){2-3}" in text
    assert r"a\_1 & 91.9\% & 2 $\pm$ 1 \\" in text
    for rule in (r"\toprule", r"\midrule", r"\bottomrule"):
        assert text.count(rule) == 1
    assert text.count("{") == text.count("}")


def test_csv_holds_the_records_and_else_the_rows() -> None:
    rows = pd.read_csv(io.StringIO(TABLE.csv()))
    assert list(rows["Name"]) == ["a_1", "<b>|x"]
    records = [{"n": 1, "mean": 0.5}, {"n": 2, "mean": None, "more": "x"}]
    tidy = Table("t", "t", ("n",), (("1",),), records=records)
    frame = pd.read_csv(io.StringIO(tidy.csv()))
    assert list(frame.columns) == ["n", "mean", "more"]
    assert frame["mean"].isna().tolist() == [False, True]
