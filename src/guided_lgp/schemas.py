"""JSON Schemas of the files that users read and write, made from the models that check them."""

from importlib import import_module
from typing import Any

from pydantic import BaseModel

from guided_lgp.errors import InputError

SCHEMAS = {
    "scene": "guided_lgp.scene.model:Scene",
    "robot": "guided_lgp.robots.document:RobotDocument",
    "plan": "guided_lgp.bounds.plan_file:Plan",
    "observed": "guided_lgp.observed:Observed",
    "planning": "guided_lgp.params:PlanningParams",
    "params": "guided_lgp.params:Params",
}
"""The formats, and where their models are."""


def schema(name: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a format.

    Args:
        name: one of :data:`SCHEMAS`.

    Raises:
        InputError: there is no such format.
    """
    if name not in SCHEMAS:
        raise InputError(f"format {name!r}", "is unknown", ", ".join(SCHEMAS))
    module, _, attribute = SCHEMAS[name].partition(":")
    model: type[BaseModel] = getattr(import_module(module), attribute)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **model.model_json_schema()}
