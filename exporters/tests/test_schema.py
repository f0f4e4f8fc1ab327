"""docs/extras.md and docs/extras.schema.json say the same; the validator is there; the exporters obey."""

from __future__ import annotations

import json
import re

import pytest
from conftest import ROOT, validator_modules

jsonschema = pytest.importorskip("jsonschema", reason="SKIPPED LOUDLY: jsonschema is not installed (pip install jsonschema)")
SCHEMA = json.loads((ROOT / "docs" / "extras.schema.json").read_text())
DOC = (ROOT / "docs" / "extras.md").read_text()


def definition(name: str):
    """A validator for one definition."""
    return jsonschema.Draft202012Validator({**SCHEMA, "$ref": f"#/$defs/{name}"})


def test_validator_is_installed():
    if validator_modules() is None:
        pytest.skip("SKIPPED LOUDLY: node or gltf-validator (npm) is not there; no export was validated")


def test_example_of_the_page_is_valid():
    example = json.loads(re.search(r"```json\n(\{.*?\n\})\n```", DOC, re.S)[1])
    definition("scene").validate(example)
    assert set(example) <= set(SCHEMA["$defs"]["scene"]["properties"])


@pytest.mark.parametrize("name", ["scene", "camera", "light"])
def test_every_key_is_described(name):
    for key in SCHEMA["$defs"][name]["properties"]:
        assert f"`{key}`" in DOC, key


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("scene", {"fps": [24]}),
        ("scene", {"fps": [0, 1]}),
        ("scene", {"resolution": [1920, 0]}),
        ("scene", {"cuts": [{"frame": 1.5, "node": 0}]}),
        ("scene", {"world": {"image": "sky.tif"}}),
        ("camera", {"shift": [1]}),
        ("light", {"radius": -1}),
        ("light", {"area": {"shape": "star", "size": [1, 1]}}),
        ("shape_binding", {"shape": 0, "quadric": [0] * 10, "bounds": {"min": [0, 0, 0], "max": [1, 1, 1]}}),
    ],
)
def test_bad_values_are_refused(name, bad):
    assert not definition(name).is_valid(bad)


def test_unknown_keys_are_allowed():
    definition("scene").validate({"something": "else", "version": 1})


def test_exports_are_checked_when_written():
    from exporters.common.extras import check
    from exporters.common.report import ExportError

    with pytest.raises(ExportError, match="/scenes/0/extras/buzz/fps"):
        check({"scenes": [{"extras": {"buzz": {"fps": [24]}}}]})
