"""Write the section on the JSON files: the content of each key, from the schemas in docs/schemas."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

SCHEMAS = Path(__file__).parent / "schemas"
HEAD = """## JSON files

Each file is described by a [JSON Schema](https://json-schema.org) in `docs/schemas`; tests validate what the program
writes against it. Keys that are not listed may be added; listed keys keep their names and meaning, and `format`
increases if a meaning changes. Numbers are in the unit stated next to them, covariances in SI. A key in *italics* is
optional."""


def page() -> str:
    """Return the section as text."""
    parts = [HEAD]
    for path in sorted(SCHEMAS.glob("*.schema.json")):
        schema = json.loads(path.read_text(encoding="utf-8"))
        rows = [f"| {name} | {kind} | {words} |" for name, kind, words in keys(schema, "")]
        parts += [f"### {schema['title']}", schema["description"] + f" Schema: `docs/schemas/{path.name}`."]
        parts.append("\n".join(["| key | type | holds |", "|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"


def keys(schema: dict[str, Any], path: str) -> Iterator[tuple[str, str, str]]:
    """Return key, type and description of all properties, each before those inside it."""
    if "items" in schema and "properties" in schema["items"]:
        yield from keys(schema["items"], f"{path}[].")
    for name, inner in schema.get("properties", {}).items():
        where = f"`{path}{name}`"
        known = name in schema.get("required", ())
        yield where if known else f"*{where}*", kind(inner), inner.get("description", "") or "–"
        yield from keys(inner, f"{path}{name}" if "items" in inner else f"{path}{name}.")


def kind(schema: dict[str, Any]) -> str:
    """Describe the type of a value."""
    if "enum" in schema or "const" in schema:
        return ", ".join(f"`{json.dumps(v)}`" for v in schema.get("enum", [schema.get("const")]))
    types = schema.get("type", "any")
    words = types if isinstance(types, str) else " or ".join(types)
    inside = schema.get("items", {})
    return f"{words} of {kind(inside)}" if inside.get("type") not in (None, "object") else words
