"""Domains are found by their files."""

from pathlib import Path

import pytest

from guided_lgp import domains
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError


@pytest.mark.parametrize("declared", ["", "DOMAIN = 3", "from .pick_and_place import DOMAIN"])
def test_a_file_without_its_domain_is_refused(
    declared: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"drawers{len(declared)}"  # modules are imported once
    (tmp_path / f"{name}.py").write_text(declared)
    monkeypatch.setattr(domains, "__path__", [*domains.__path__, str(tmp_path)])
    with pytest.raises(InputError, match=rf"{name}\.py: DOMAIN: is missing"):
        load_domain(name)
    with pytest.raises(InputError, match=rf"unknown 'chess' \(accepted: {name}, handover"):
        load_domain("chess")
