"""The relational policy: one network for any number of grippers, boxes, tables and goals."""

from pathlib import Path

from guided_lgp.policy.declaration import DeclaredPolicy, PolicyDeclaration


def _relational(directory: Path) -> DeclaredPolicy:
    from guided_lgp.policy.relational.inference import load_relational

    return load_relational(directory)


DECLARATIONS = (
    PolicyDeclaration(
        name="relational",
        label="Relational policy",
        summary="for any number of boxes and tables",
        color="#CC79A7",
        read=_relational,
        stage="train_relational",
        networks=("relational",),
        default=True,
    ),
)
