"""`schemas`: writes the JSON Schemas, the glossary and the keys of source maps."""

from __future__ import annotations

from pathlib import Path

import pipeline
from pipeline.contracts.glossary_page import glossary_page
from pipeline.contracts.json_schema import build_schemas
from pipeline.criticism.policy.policy import DEFAULT as MODELS
from pipeline.estimation.policy import DEFAULT as ESTIMATORS
from pipeline.io.maps.keys import SCHEMA_ID, keys_page, map_schema
from pipeline.io.storage.publish import canonical_json, write_whole
from pipeline.records.errors import UsageError
from pipeline.records.outcome import Outcome
from pipeline.report.pages.policy_page import policy_page
from pipeline.settings import Settings

SCHEMA_FOLDER = "pipeline/contracts/json"
GLOSSARY_PAGE = "docs/glossary.md"
POLICY_PAGE = "docs/policy.md"
POLICIES = {"Models": MODELS, "Estimators": ESTIMATORS}
KEYS_PAGE = "docs/source-map-keys.md"
MAP_FOLDER = "conf/source"


def build() -> dict[str, bytes]:
    """Files that are built from the code: path in the repository, content."""
    files = {
        f"{SCHEMA_FOLDER}/{stem}.schema.json": canonical_json(schema)
        for stem, schema in build_schemas().items()
    }
    pages = {
        GLOSSARY_PAGE: glossary_page(),
        POLICY_PAGE: policy_page(POLICIES),
        KEYS_PAGE: keys_page(),
    }
    files |= {name: page.encode() for name, page in pages.items()}
    return files | {f"{MAP_FOLDER}/{SCHEMA_ID}": canonical_json(map_schema())}


def main(settings: Settings) -> Outcome:
    """Writes every built file into the checkout.

    Parameters
    ----------
    settings
        The command has no keys of its own.

    Raises
    ------
    UsageError
        There is none.

    """
    del settings
    root = Path(pipeline.__file__).parent.parent
    if not (root / "pyproject.toml").is_file():
        raise UsageError("schemas are written into a checkout", "run it from a clone")
    files = build()
    for name, content in files.items():
        write_whole(root / name, content)
    return Outcome(text="\n".join(files))
