# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The results of a fleet as tables, one Parquet file each, that DuckDB, pandas or polars read."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

from lugre_steering.errors import LugreSteeringError
from lugre_steering.files import MAKER, replacing
from lugre_steering.fleet.changes import Difference
from lugre_steering.fleet.claims import Claim
from lugre_steering.fleet.work import Record
from lugre_steering.provenance import Provenance

Columns = Mapping[str, str]
"""Type of each column: text, number, whole or truth."""
_OF = {"str": "text", "float": "number", "int": "whole", "bool": "truth"}


def _columns(cls: type) -> dict[str, str]:
    """The columns that a dataclass becomes."""
    return {item.name: _OF.get(str(item.type).partition(" ")[0], "text") for item in fields(cls)}


SCORES: Columns = {
    "vehicle": "text", "bag": "text", "bag_sha256": "text", "version": "text", "recorded": "text", "duration_s": "number",
    "air_degC": "number", "rubber_degC": "number", "samples": "whole", "rmse_Nm": "number", "r2": "number", "bias_Nm": "number",
    "verdict": "text", "quarantine": "text", "seconds": "number",
}  # fmt: skip
FINDINGS: Columns = {
    "vehicle": "text", "bag": "text", "bag_sha256": "text", "finding": "text", "topic": "text", "begin_s": "number", "end_s": "number",
    "statement": "text",
}  # fmt: skip
EFFECTS: Columns = {
    "vehicle": "text", "bag": "text", "bag_sha256": "text", "recorded": "text", "effect": "text", "parameter": "text", "unit": "text",
    "value": "number", "low": "number", "high": "number", "p_value": "number", "energy_share": "number", "masked_share": "number",
    "largest_Nm": "number", "largest_share": "number",
}  # fmt: skip
ESTIMATES: Columns = {
    "vehicle": "text", "bag": "text", "bag_sha256": "text", "recorded": "text", "effect": "text", "shape": "whole", "parameter": "text",
    "unit": "text", "value": "number", "sd": "number", "sign": "whole", "each_Nm": "number", "each_share": "number",
}  # fmt: skip
KINDS: Mapping[str, Columns] = {
    "scores": SCORES, "findings": FINDINGS, "effects": EFFECTS, "estimates": ESTIMATES, "claims": _columns(Claim),
    "changes": _columns(Difference),
}  # fmt: skip
"""The tables by name, each with its columns."""


def need_parquet() -> None:
    """Say what to install where Parquet cannot be written."""
    if importlib.util.find_spec("pyarrow") is None:
        raise LugreSteeringError("fleet: its tables are Parquet, which needs pyarrow (pip install 'lugre_steering[fleet]')")


def rows(records: Sequence[Record], claims: Sequence[Claim], changes: Sequence[Difference]) -> dict[str, list[dict[str, Any]]]:
    """The rows of every table."""
    return {
        "scores": [_score(record) for record in records],
        "findings": [row for record in records for row in _findings(record)],
        "effects": [row for record in records for row in _effects(record)],
        "estimates": [{**_who(record), **one} for record in records for one in record["estimates"]],
        "claims": [asdict(claim) for claim in claims],
        "changes": [asdict(change) for change in changes],
    }


def write_tables(tables: Mapping[str, Sequence[Mapping[str, Any]]], out: Path, made: Provenance) -> None:
    """Each as NAME.parquet, whole or not at all; an empty one has its columns too. Its metadata tells how it was ``made``, but for the
    bags, whose hashes stand in the rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {"text": pa.string(), "number": pa.float64(), "whole": pa.int64(), "truth": pa.bool_()}
    for name, columns in KINDS.items():
        schema = pa.schema([(column, types[kind]) for column, kind in columns.items()], {MAKER: "\n".join(replace(made, bags=()).lines())})
        data = {column: [row.get(column) for row in tables[name]] for column in columns}
        with replacing(out / f"{name}.parquet") as stream:
            pq.write_table(pa.table(data, schema=schema), stream)


def _who(record: Record) -> dict[str, Any]:
    return {"vehicle": record["member"], "bag": record["bag"], "bag_sha256": record.get("bag_sha256"), "recorded": record["recorded"]}


def _score(record: Record) -> dict[str, Any]:
    return {**_who(record), **{name: record.get(name) for name in SCORES if name not in ("vehicle", "bag")}, **(record["score"] or {})}


def _findings(record: Record) -> Iterator[dict[str, Any]]:
    for found in record["findings"]:
        spans: Iterable[Sequence[float | None]] = found["intervals_s"] or [(None, None)]
        for begin, end in spans:
            told = {name: found[name] for name in ("finding", "topic", "statement")}
            yield {**_who(record), **told, "begin_s": begin, "end_s": end}


def _effects(record: Record) -> Iterator[dict[str, Any]]:
    for effect in record["effects"]:
        shared = {name: effect[name] for name in ("p_value", "energy_share", "masked_share", "largest_Nm", "largest_share")}
        for name, fitted in effect["parameters"].items():
            low, high = fitted["ci95"]
            numbers = {"value": fitted["value"], "low": low, "high": high, "unit": fitted["unit"]}
            yield {**_who(record), **shared, "effect": effect["id"], "parameter": name, **numbers}
