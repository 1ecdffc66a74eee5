"""Writes the types of the API that the page uses, from the description of the API: server/web/page/types.d.ts.

    signorini openapi | python tests/page/api_types.py           prints them
    signorini openapi | python tests/page/api_types.py --write   writes the file
    signorini openapi | python tests/page/api_types.py --check   fails if the file differs
"""

import json
import pathlib
import sys

FILE = pathlib.Path(__file__).parents[2] / "server/web/page/types.d.ts"
HEAD = "// Written by tests/page/api_types.py from the description of the API; do not edit.\n"
WORDS = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}


def name_of(reference):
    """The name of the type that a reference names."""
    return reference.rsplit("/", 1)[1]


def type_of(schema):
    """A schema as a type of TypeScript."""
    if isinstance(schema, dict) and schema.get("nullable"):
        return f"({type_of({**schema, 'nullable': False})}) | null"
    if schema is True or not schema:
        return "unknown"
    if "$ref" in schema:
        return name_of(schema["$ref"])
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(json.dumps(word) for word in schema["enum"])
    for several in ("anyOf", "oneOf"):
        if several in schema:
            return " | ".join(dict.fromkeys(f"({type_of(one)})" for one in schema[several]))
    kind = schema.get("type")
    if isinstance(kind, list):
        return " | ".join(dict.fromkeys(type_of({**schema, "type": one}) for one in kind))
    if kind == "array":
        if "prefixItems" in schema:
            return "[" + ", ".join(type_of(one) for one in schema["prefixItems"]) + "]"
        return f"({type_of(schema.get('items', True))})[]"
    if kind == "object" or "properties" in schema:
        return object_of(schema)
    if "allOf" in schema:
        return " & ".join(f"({type_of(one)})" for one in schema["allOf"])
    return WORDS.get(kind, "unknown")


def object_of(schema):
    """A schema of an object as a type."""
    required = set(schema.get("required", []))
    lines = [
        f"  {json.dumps(name)}{'' if name in required else '?'}: {type_of(member)};"
        for name, member in schema.get("properties", {}).items()
    ]
    other = schema.get("additionalProperties")
    if not lines:
        return f"Record<string, {type_of(other)}>" if isinstance(other, dict) else "Record<string, unknown>"
    return "{\n" + "\n".join(lines) + "\n}"


def types(description):
    """All schemas of the API as declarations."""
    schemas = description["components"]["schemas"]
    return HEAD + "".join(f"\nexport type {name} = {type_of(schema)};\n" for name, schema in sorted(schemas.items()))


def main():
    text = types(json.load(sys.stdin))
    if "--write" in sys.argv:
        FILE.write_text(text)
    elif "--check" in sys.argv:
        if FILE.read_text() != text:
            sys.exit(f"{FILE.name} is not that of the API: signorini openapi | python tests/page/api_types.py --write")
    else:
        print(text)


if __name__ == "__main__":
    main()
