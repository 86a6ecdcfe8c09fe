"""``doctor``: whether the installation is whole."""

import json
from dataclasses import asdict
from typing import Annotated

import typer

from guided_lgp.cli.terminal import AsJson, show

app = typer.Typer()


@app.command()
def doctor(
    as_json: AsJson = False,
    mend: Annotated[
        bool, typer.Option("--repair", help="Mend a damaged cache.", show_default="check only")
    ] = False,
) -> None:
    """Check the installation and say how to mend what is missing.

    Example: guided-lgp doctor --repair
    """
    from guided_lgp.doctor import examine, repair

    for line in repair() if mend else ():
        typer.echo(f"mended: {line}", err=True)
    findings = examine()
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=1))
    else:
        marks = {True: "ok", False: "FAIL"}
        show(
            ["", "check", "found", "how to mend it"],
            [
                (marks[finding.ok], finding.name, finding.detail, finding.mend)
                for finding in findings
            ],
        )
    if not all(finding.ok for finding in findings):
        raise typer.Exit(1)
