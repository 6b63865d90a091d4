# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""JSON schemas of the result files, made from the dataclasses: ``python -m lugre_steering.schemas DIR`` writes them."""

from __future__ import annotations

import argparse
import dataclasses
import sys
import types
import typing
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Union

from lugre_steering.calibration.result import Calibration
from lugre_steering.diagnosis.result import Diagnosis
from lugre_steering.errors import LugreSteeringError
from lugre_steering.fleet.result import Fleet
from lugre_steering.proof.result import Scoreboard
from lugre_steering.replay.result import Replay
from lugre_steering.result import writing_into
from lugre_steering.serialise import as_json, key_of, written
from lugre_steering.simulate.paper.result import PublishedExperiment, PublishedExperiments
from lugre_steering.simulate.result import Simulation

FILES: Mapping[str, type] = {
    "diagnosis": Diagnosis, "calibration": Calibration, "summary": Replay, "fleet": Fleet, "scoreboard": Scoreboard,
    "simulation": Simulation, "experiment": PublishedExperiment, "experiments": PublishedExperiments,
}  # fmt: skip
"""Results by the stem of their file's name; the last three by what ``simulate`` made: a recording is told by ``--json`` alone, a published
experiment in a file of its own name, several by ``--json`` and in the file of all together."""
DIALECT = "https://json-schema.org/draft/2020-12/schema"
_SIMPLE: dict[Any, dict[str, Any]] = {
    float: {"type": "number"}, int: {"type": "integer"}, bool: {"type": "boolean"}, str: {"type": "string"},
    type(None): {"type": "null"}, Any: {},
}  # fmt: skip


def schema_of(result: type) -> dict[str, Any]:
    """The schema of a result; the dataclasses inside it stand under ``$defs``, their docstrings as descriptions."""
    definitions: dict[str, Any] = {}
    top = _object(result, definitions)
    return {"$schema": DIALECT, "title": result.__name__, **top, "$defs": dict(sorted(definitions.items()))}


def _object(cls: type, definitions: dict[str, Any]) -> dict[str, Any]:
    hints = typing.get_type_hints(cls, include_extras=True)
    required = [key_of(item) for item in written(cls) if item.metadata.get("required", True)]
    properties = {key_of(item): _of(hints[item.name], definitions) for item in written(cls)}
    text = " ".join((cls.__doc__ or "").split())
    return {"type": "object", "description": text, "required": required, "properties": properties}


def _of(hint: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """The schema of one type; an annotation of it holds further keywords."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        return {**_of(arguments[0], definitions), **arguments[1]}
    if hint in _SIMPLE:
        return dict(_SIMPLE[hint])
    if origin is Literal:
        return {"enum": list(arguments)}
    if origin in (Union, types.UnionType):
        return {"anyOf": [_of(argument, definitions) for argument in arguments]}
    if origin is tuple and arguments[-1] is Ellipsis:
        return {"type": "array", "items": _of(arguments[0], definitions)}
    if origin is tuple:
        count = len(arguments)
        items = [_of(argument, definitions) for argument in arguments]
        return {"type": "array", "prefixItems": items, "minItems": count, "maxItems": count}
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {"type": "object", "additionalProperties": _of(arguments[1], definitions)}
    if not isinstance(hint, type) or not dataclasses.is_dataclass(hint):
        raise TypeError(f"{hint}: no JSON type is known for it")
    if hint.__name__ not in definitions:
        definitions[hint.__name__] = {}  # known while its own fields are looked at
        definitions[hint.__name__] = _object(hint, definitions)
    return {"$ref": f"#/$defs/{hint.__name__}"}


def main() -> int:
    parser = argparse.ArgumentParser(description="write the JSON schemas of the result files")
    parser.add_argument("folder", help="where NAME.schema.json is written for each of: " + ", ".join(FILES))
    try:
        with writing_into(parser.parse_args().folder) as folder:
            for name, result in FILES.items():
                (folder / f"{name}.schema.json").write_text(as_json(schema_of(result)) + "\n", encoding="utf-8")
    except LugreSteeringError as error:
        print(f"schemas: {error}", file=sys.stderr)
        return 2
    print(f"schemas in {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
