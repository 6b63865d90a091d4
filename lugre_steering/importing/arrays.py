# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Binary tables: npz, Parquet, MATLAB before and after 7.3. What a file declares is weighed before it is unpacked."""

from __future__ import annotations

import importlib
import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from lugre_steering.errors import MapFileError
from lugre_steering.importing.structured import collect_records
from lugre_steering.importing.table import MAX_COLUMNS, MAX_DEPTH, UNIT_KEYS, Gathering, Table, most_numbers, size_of

_CHUNK = 1 << 16


def optional(file: Path, module: str, package: str) -> Any:
    """A reader that not everybody has installed."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MapFileError(f"{file}: needs {package} to be read (pip install 'lugre_steering[import]')") from None


def too_large(file: Path) -> MapFileError:
    return MapFileError(f"{file}: unpacks to more than {8 * most_numbers(file)} bytes, which is too much for its size; split it")


# ------------------------------------------------------------------ npz


def read_npz(file: Path) -> Table:
    """The arrays of a NumPy archive; objects (pickles) are never loaded."""
    found, wanted = Gathering(file), []
    with zipfile.ZipFile(file) as archive:
        for member in archive.infolist():
            if member.filename.endswith(".npy"):
                name = member.filename.removesuffix(".npy")
                with archive.open(member) as stream:
                    shape, dtype = _npy_header(stream)
                if dtype.hasobject:
                    found.refuse(name, "Python objects")
                    continue
                if size_of(shape) * dtype.itemsize > member.file_size:
                    raise MapFileError(f"{file}: '{name}': declares {size_of(shape)} values, more than the file holds")
                found.reserve(name, size_of(shape))
                wanted.append((name, member))
        for name, member in wanted:
            with archive.open(member) as stream:
                found.add(name, np.lib.format.read_array(stream, allow_pickle=False))
    return found.table()


def _npy_header(stream: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    return shape, dtype


# -------------------------------------------------------------- Parquet


def read_parquet(file: Path) -> Table:
    """The numbers, truth values and times (as ns) of a Parquet file."""
    parquet, arrow = optional(file, "pyarrow.parquet", "pyarrow"), optional(file, "pyarrow", "pyarrow")
    found, titles = Gathering(file), {}
    with parquet.ParquetFile(file) as source:
        schema, metadata = source.schema_arrow, source.metadata
        if len(schema.names) > MAX_COLUMNS:
            raise MapFileError(f"{file}: has {len(schema.names)} columns, expected at most {MAX_COLUMNS}")
        if sum(metadata.row_group(i).total_byte_size for i in range(metadata.num_row_groups)) > 8 * most_numbers(file):
            raise too_large(file)
        wanted = []
        for field in schema:
            if not _is_number(arrow.types, field.type):
                found.refuse(field.name, f"values of type {field.type}")
            elif schema.names.count(field.name) > 1:
                found.unusable[field.name] = f"column '{field.name}' occurs twice"
            else:
                found.reserve(field.name, metadata.num_rows)
                wanted.append(field.name)
        parts: dict[str, list[Any]] = {name: [] for name in wanted}
        rows = 0
        for batch in source.iter_batches(columns=wanted):
            rows += batch.num_rows
            if rows > metadata.num_rows:
                raise MapFileError(f"{file}: holds more rows than the {metadata.num_rows} it declares")
            for name in wanted:
                parts[name].append(_floats(arrow, batch.column(name)))
        for name, pieces in parts.items():
            found.columns[name] = np.concatenate(pieces) if pieces else np.empty(0)
            if arrow.types.is_temporal(schema.field(name).type):
                titles[name] = ("ns",)
    return found.table(titles)


def _is_number(types: Any, kind: Any) -> bool:
    tests = (types.is_integer, types.is_floating, types.is_boolean, types.is_decimal, types.is_timestamp, types.is_duration)
    return any(test(kind) for test in tests)


def _floats(arrow: Any, column: Any) -> Any:
    if arrow.types.is_timestamp(column.type):
        column = column.cast(arrow.timestamp("ns")).cast(arrow.int64())
    elif arrow.types.is_duration(column.type):
        column = column.cast(arrow.duration("ns")).cast(arrow.int64())
    elif arrow.types.is_boolean(column.type):
        column = column.cast(arrow.int8())
    return column.cast(arrow.float64(), safe=False).to_numpy(zero_copy_only=False)


# --------------------------------------------------------------- MATLAB


def read_mat(file: Path) -> Table:
    """The numeric variables of a MATLAB file of any version."""
    with file.open("rb") as stream:
        head = stream.read(128)
        if head[124:126] in (b"\x00\x02", b"\x02\x00") or head.startswith(b"\x89HDF"):
            return read_hdf5(file)
        _weigh_mat(file, stream, "<" if head[126:128] == b"IM" else ">")
    from scipy.io import loadmat

    content = loadmat(file, simplify_cells=True)
    found = Gathering(file)
    _collect(found, "", {k: v for k, v in content.items() if not k.startswith("__")})
    return found.table()


def _weigh_mat(file: Path, stream: BinaryIO, order: str) -> None:
    """Refuse what unpacks to too much: SciPy trusts the compressed variables of a file."""
    total, most = 0, 8 * most_numbers(file)
    while len(tag := stream.read(8)) == 8:
        kind, size = struct.unpack(f"{order}II", tag)
        if kind != 15:  # not compressed
            stream.seek(size, 1)
            continue
        unpacked = zlib.decompressobj()
        while size > 0 and (packed := stream.read(min(size, _CHUNK))):
            size -= len(packed)
            while packed and total <= most:
                total += len(unpacked.decompress(packed, _CHUNK << 4))
                packed = unpacked.unconsumed_tail
            if total > most:
                raise too_large(file)


def _collect(found: Gathering, name: str, value: Any, depth: int = 0) -> None:
    if isinstance(value, Mapping):
        if depth > MAX_DEPTH:
            raise MapFileError(f"{found.file}: '{name[:60]}': nested more than {MAX_DEPTH} deep")
        for key, inner in value.items():
            _collect(found, f"{name}.{key}" if name else key, inner, depth + 1)
        found.state(name, value)
    elif isinstance(value, list) and value and all(isinstance(item, Mapping) for item in value):
        _collect_structs(found, name, value, depth)
    elif isinstance(value, list):
        found.refuse(name, "a cell array")
    else:
        found.add(name, value)


def _collect_structs(found: Gathering, name: str, structs: Sequence[Mapping[str, Any]], depth: int) -> None:
    """A struct array: a table where all fields are single numbers, else each by its label, as Simulink has it, or its place."""
    if all(np.size(field) <= 1 for each in structs for field in each.values()):
        collect_records(found, name, [{key: field if np.size(field) else None for key, field in each.items()} for each in structs])
        return
    labels = [label for each in structs if isinstance(label := each.get("label"), str) and label]
    for place, each in enumerate(structs):
        ending = f".{labels[place]}" if len(set(labels)) == len(structs) else f"[{place + 1}]"
        _collect(found, name + ending, each, depth + 1)


# ----------------------------------------------------- HDF5, MATLAB 7.3


def read_hdf5(file: Path) -> Table:
    """The numeric datasets of an HDF5 file; groups by dots. Nothing outside the file is followed."""
    h5py = optional(file, "h5py", "h5py")
    found = Gathering(file)
    with h5py.File(file, "r") as content:
        _collect_hdf5(found, h5py, content, "", set())
    return found.table()


def _collect_hdf5(found: Gathering, h5py: Any, group: Any, name: str, seen: set[int]) -> None:
    """``seen``: groups that were entered; one may be linked from many places, itself included."""
    place = h5py.h5o.get_info(group.id).addr
    if place in seen:
        return found.refuse(name, "a group that stands elsewhere too")
    if len(seen) > MAX_COLUMNS or name.count(".") > MAX_DEPTH:
        raise MapFileError(f"{found.file}: '{name[:60]}': more than {MAX_COLUMNS} groups, or {MAX_DEPTH} deep")
    seen.add(place)
    for key in group:
        path = f"{name}.{key}" if name else key
        if key in ("#refs#", "#subsystem#"):  # where MATLAB keeps what cell arrays refer to
            continue
        if not isinstance(group.get(key, getlink=True), h5py.HardLink):
            found.refuse(path, "a link")
            continue
        item = group[key]
        if isinstance(item, h5py.Group):
            _collect_hdf5(found, h5py, item, path, seen)
        elif isinstance(item, h5py.Dataset):
            _add_dataset(found, item, path)


def _add_dataset(found: Gathering, item: Any, path: str) -> None:
    matlab = item.attrs.get("MATLAB_class")
    if item.dtype.kind not in "iufb" or matlab in (b"char", b"cell") or "MATLAB_empty" in item.attrs:
        found.refuse(path, "no plain numbers")
    elif item.shape is None or item.external or item.is_virtual:
        found.refuse(path, "data of another file" if item.shape is not None else "nothing")
    else:
        found.reserve(path, size_of(item.shape))
        values = np.asarray(item[()], np.float64)
        found.add(path, values.T if matlab is not None else values)  # MATLAB counts dimensions the other way round
        stated = {key: item.attrs[key] for key in item.attrs if key.lower() in UNIT_KEYS}
        found.state(path, {key: text.decode(errors="replace") if isinstance(text, bytes) else text for key, text in stated.items()})
