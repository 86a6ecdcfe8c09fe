"""Hooks of the documentation site: JSON Schemas written from the models that read the files."""

import json

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from guided_lgp.schemas import SCHEMAS, schema


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add ``schemas/NAME.schema.json`` for every format."""
    for name in SCHEMAS:
        content = json.dumps(schema(name), indent=1)
        files.append(File.generated(config, f"schemas/{name}.schema.json", content=content))
    return files
