# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables as people have them, damaged ones, and such that would fill the memory."""

from __future__ import annotations

import importlib.util
import io
import json
import struct
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from lugre_steering.errors import MapFileError
from lugre_steering.importing import read_table, table
from lugre_steering.importing.map import Csv
from lugre_steering.importing.sniff import sniff

needs_h5py = pytest.mark.skipif(importlib.util.find_spec("h5py") is None, reason="h5py is not installed")
needs_pyarrow = pytest.mark.skipif(importlib.util.find_spec("pyarrow") is None, reason="pyarrow is not installed")


def write(folder: Path, name: str, text: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


# ------------------------------------------------------------------ CSV


def test_no_header(tmp_path: Path) -> None:
    file = write(tmp_path, "log.txt", "0.000\t3.5\t-1\r\n11.000\t3.6\t-2\r\n")
    found = read_table(file, Csv(delimiter="\t", header_rows=0))
    assert list(found.columns) == ["c1", "c2", "c3"]
    assert list(found.column("c3")) == [-1.0, -2.0]
    named = read_table(file, Csv(delimiter="\t", header_rows=0, columns=("t", "x", "F")))
    assert list(named.column("x")) == [3.5, 3.6]
    for options in (Csv(delimiter="\t"), Csv(delimiter="\t", columns=("t", "x", "F"))):  # else a row would be lost in silence
        with pytest.raises(MapFileError, match=r"line 1: the header holds numbers, expected .* csv\.header_rows: 0"):
            read_table(file, options)


def test_metadata_several_header_rows_a_header_that_comes_again_and_a_footer(tmp_path: Path) -> None:
    text = "Logger,3000\nt,angle\n[s],[deg]\nraw,raw\n0,1\nt,angle\n1,2\nrestarted at,noon\n2,3\nend\n"
    file = write(tmp_path, "log.csv", text)
    options = {"skip_rows": 1, "header_rows": 3}
    with pytest.raises(MapFileError, match=r"line 10: has 1 cells, expected 2.*short_rows"):
        read_table(file, Csv(**options))
    found = read_table(file, Csv(**options, allow=("text_rows",)))
    assert (list(found.column("t")), list(found.column("angle"))) == ([0.0, 1.0, 2.0], [1.0, 2.0, 3.0])
    assert found.left_out == {"repeated header rows": 1, "rows without a number": 2}
    assert found.titles["angle"] == ("[deg]", "raw")


def test_names_in_the_second_header_row_and_the_same_name_twice(tmp_path: Path) -> None:
    file = write(tmp_path, "log.csv", "left,,right,\nt,a,t,a\n0,1,5,2\n1,3,6,4\n")
    found = read_table(file, Csv(header_rows=2, name_row=2))
    assert (list(found.column("t[2]")), list(found.column("a[1]"))) == ([5.0, 6.0], [1.0, 3.0])
    with pytest.raises(MapFileError, match=r"column 'a' occurs twice; expected 'a\[1\]'"):
        found.column("a")


def test_trailing_commas_and_unequal_columns(tmp_path: Path) -> None:
    file = write(tmp_path, "log.csv", "t,a,tp,p,\n0,1,0,10,,\n1,2,2,20,\n2,3\n3,4,,,,,\n")
    with pytest.raises(MapFileError, match="line 4: has 2 cells, expected 4"):
        read_table(file)
    found = read_table(file, Csv(allow=("short_rows",)))
    assert list(found.column("a")) == [1.0, 2.0, 3.0, 4.0]
    assert found.column("p") == pytest.approx([10.0, 20.0, np.nan, np.nan], nan_ok=True)
    with pytest.raises(MapFileError, match="line 2: has 3 cells, expected 2"):
        read_table(write(tmp_path, "more.csv", "t,a\n0,1,2\n"))


def test_text_among_numbers_is_refused_unless_it_is_said_to_be_missing(tmp_path: Path) -> None:
    file = write(tmp_path, "log.csv", "t,a\n0,1\n1,OVER\n2,3\n")
    assert list(read_table(file).column("t")) == [0.0, 1.0, 2.0]
    with pytest.raises(MapFileError, match=r"line 3, column 'a': got 'OVER', .* csv\.allow: \[text_cells\] takes text as missing$"):
        read_table(file).column("a")
    found = read_table(file, Csv(allow=("text_cells",)))
    assert found.column("a") == pytest.approx([1.0, np.nan, 3.0], nan_ok=True)
    assert found.left_out == {"cells of text (count as missing)": 1}
    with pytest.raises(MapFileError, match="got 'OVER OUT', expected"):  # one line
        read_table(write(tmp_path, "log.csv", 't,a\n0,1\n1,"OVER\nOUT"\n')).column("a")


@pytest.mark.parametrize(
    ("text", "options", "wanted"),
    [
        ('t,a\n0,1\n# event, "valve open\n2,3\n3,4\n', Csv(), [1.0, 3.0, 4.0]),
        ('Remark,"open\nt,a\n0,1\n1,2\n', Csv(skip_rows=1), [1.0, 2.0]),
        ('t,a,note\n0,1,"two\nlines"\n1,2,\n', Csv(), [1.0, 2.0]),
        ('t,"a\n"\n0,1\n1,2\n', Csv(), [1.0, 2.0]),
        ("a,p\n1,5\n#N/A,5\n # remark\n4,5\n", Csv(), [1.0, np.nan, 4.0]),
        ("a,p\n,\n1,5\n,\n\n,\n4,5\n,\n", Csv(allow=("text_rows",)), [1.0, np.nan, np.nan, 4.0]),
        ("a\n1\n\n4\n\n", Csv(), [1.0, np.nan, 4.0]),
        (" , \na,p\n , \n1,5\n,\n2,5\n", Csv(), [1.0, np.nan, 2.0]),
        ('a,p\n1,"x\x0cy,z"\n', Csv(), [1.0]),
    ],
)
def test_no_row_of_numbers_gets_lost(tmp_path: Path, text: str, options: Csv, wanted: list[float]) -> None:
    assert read_table(write(tmp_path, "log.csv", text), options).column("a") == pytest.approx(wanted, nan_ok=True)


@pytest.mark.parametrize("rows", [3, 20_000])
def test_a_quote_that_is_not_closed_is_told_where_it_is(tmp_path: Path, rows: int) -> None:
    file = write(tmp_path, "log.csv", '# a\nt,a,note\n0,1,"5\n' + "1,2,\n" * rows + '3,4,"x"\n')
    with pytest.raises(MapFileError, match=r"log\.csv: line 3: a cell begins with a quote that its row does not close"):
        read_table(file)


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("0,0;1,5\n0,1;2,5\n", Csv(";", ",", columns=("t", "a"))), ("12:00:00,1\n12:00:01,2\n", Csv(columns=("t", "a"))),
        ("0,1\n1,2\n", Csv(columns=("t", "a"))), ("0.5,,1\n0.6,1,2\n", Csv()),
    ],
)  # fmt: skip
def test_a_first_row_of_numbers_is_no_header(tmp_path: Path, text: str, options: Csv) -> None:
    with pytest.raises(MapFileError, match=r"line 1: the header holds numbers, expected .* csv\.header_rows: 0"):
        read_table(write(tmp_path, "log.csv", text), options)
    assert list(read_table(write(tmp_path, "log.csv", "1,2,3\n0,1,2\n")).columns) == ["1", "2", "3"]


@pytest.mark.parametrize("cell", ["#NV", "#DIV/0!", "1.#QNAN", "-1.#IND", "--.--"])
def test_what_programs_write_where_there_is_no_number(tmp_path: Path, cell: str) -> None:
    found = read_table(write(tmp_path, "log.csv", f"t,a\n0,1\n1,{cell}\n"))
    assert found.column("a") == pytest.approx([1.0, np.nan], nan_ok=True)
    assert found.left_out == {"cells of '-', '?', '#N/A' and the like (count as missing)": 1}


def test_columns_apart_by_blanks_and_other_encodings(tmp_path: Path) -> None:
    file = write(tmp_path, "log.dat", "  t      a \n 0.0   -1.5\n 1.0\t  2.5  \n")
    assert list(read_table(file, Csv(delimiter="whitespace")).column("a")) == [-1.5, 2.5]
    for encoding in ("latin-1", "utf-16"):
        file = write(tmp_path, "log.csv", "t,Winkel [°]\n0,1\n".encode(encoding))
        with pytest.raises(MapFileError, match=r"cannot be read as utf-8.*csv\.encoding"):
            read_table(file)
        assert list(read_table(file, Csv(encoding=encoding)).column("Winkel [°]")) == [1.0]


@pytest.mark.parametrize(
    ("cell", "unix"),
    [
        ("2026-11-22 05:30:00", 1795325400.0), ("2026-11-22T05:30:00.25Z", 1795325400.25),
        ("2026-11-22T07:30:00,125+02:00", 1795325400.125), ("1970-01-01T00:00:01-0130", 5401.0),
        ("2026/11/22 05:30:00:250", 1795325400.25), ("2026.11.22 05:30:00 UTC", 1795325400.0), ("2026-11-22T07:30:00+02", 1795325400.0),
    ],
)  # fmt: skip
def test_dates_are_unix_times(tmp_path: Path, cell: str, unix: float) -> None:
    file = write(tmp_path, "log.csv", f"stamp;a\n{cell};1\n")
    assert list(read_table(file, Csv(delimiter=";")).column("stamp")) == [pytest.approx(unix, abs=1e-6)]


@pytest.mark.parametrize("cell", ["25.10.26 05:30:00", "59:57.00", "22-11-2026", "05:30"])
def test_dates_of_other_forms_are_told_what_is_read(tmp_path: Path, cell: str) -> None:
    file = write(tmp_path, "log.csv", f"stamp;a\n{cell};1\n")
    with pytest.raises(MapFileError, match=rf"got '{cell}', expected a number .* a date or time as 2026-11-22 05:30:00\.25\+01:00"):
        read_table(file, Csv(delimiter=";")).column("stamp")


def test_a_day_that_is_none_is_no_number(tmp_path: Path) -> None:
    file = write(tmp_path, "log.csv", "stamp,a\n2026-02-30 00:00:00,1\n")
    with pytest.raises(MapFileError, match="got '2026-02-30 00:00:00', expected a number"):
        read_table(file).column("stamp")


def test_a_long_csv_is_read_by_blocks(tmp_path: Path) -> None:
    t = np.arange(10_000) * 0.01
    file = write(tmp_path, "log.csv", "t,a\n" + "".join(f"{x:.2f},{'' if i % 7 else i}\n" for i, x in enumerate(t)))
    found = read_table(file)
    assert found.column("t") == pytest.approx(t)
    assert np.nansum(found.column("a")) == sum(range(0, 10_000, 7))


# ----------------------------------------------------------------- JSON


def test_json_records_columns_matrices_and_single_numbers(tmp_path: Path) -> None:
    content = {
        "mass": 0.5, "motor": "x", "ok": True,
        "entries": [{"t": 0.0, "q": 1, "imu": {"w": [1, 2]}}, {"t": 0.1, "imu": {"w": [3, 4]}}, {"t": "0.2", "q": None}],
        "lists": {"a": [1, 2, 3], "b": [1, "x", 3]}, "matrix": [[0, 10], [1, 11], [2, 12]], "wide": [[0, 1, 2], [10, 11, 12]],
    }  # fmt: skip
    found = read_table(write(tmp_path, "log.json", json.dumps(content)))
    assert found.scalars == {"mass": 0.5, "ok": 1.0}
    assert list(found.column("entries.t")) == [0.0, 0.1, 0.2]
    assert found.column("entries.q") == pytest.approx([1.0, np.nan, np.nan], nan_ok=True)
    assert found.column("entries.imu.w[2]") == pytest.approx([2.0, 4.0, np.nan], nan_ok=True)
    assert list(found.column("lists.a")) == [1.0, 2.0, 3.0]
    assert list(found.column("matrix[2]")) == list(found.column("wide[2]")) == [10.0, 11.0, 12.0]
    with pytest.raises(MapFileError, match=r"'lists\.b': value 2 is 'x', expected a number or null"):
        found.column("lists.b")
    with pytest.raises(MapFileError, match=r"no column 'entries\.tt'; did you mean 'entries\.t'"):
        found.column("entries.tt")


def test_json_rows_below_a_row_of_names(tmp_path: Path) -> None:
    found = read_table(write(tmp_path, "log.json", '{"log": [["t", "a"], [0, 1], [1, null], [2, "3"]]}'))
    assert list(found.column("log.t")) == [0.0, 1.0, 2.0]
    assert found.column("log.a") == pytest.approx([1.0, np.nan, 3.0], nan_ok=True)


@pytest.mark.parametrize("name", ["log.jsonl", "log.json"])
def test_one_json_object_per_line(tmp_path: Path, name: str) -> None:
    found = read_table(write(tmp_path, name, '{"t": 0, "a": 1}\n\n{"t": 1, "a": NaN}\n'))
    assert found.column("a") == pytest.approx([1.0, np.nan], nan_ok=True)


@pytest.mark.parametrize("end", ['{"t": 3, "a', '{"t": 3, "a\0\0', "\0" * 512, ""])
def test_json_lines_that_the_end_of_the_file_cuts_off(tmp_path: Path, end: str) -> None:
    found = read_table(write(tmp_path, "log.jsonl", '{"t": 0, "a": "\u2028"}\r\n{"t": 1}\n' + end))
    assert list(found.column("t")) == [0.0, 1.0]
    assert found.left_out == ({"records that the end of the file cuts off": 1} if "t" in end else {})


def test_a_tail_of_nul_is_no_row(tmp_path: Path) -> None:
    file = write(tmp_path, "log.csv", "t,a\n0,1\n1,2\n" + "\0" * (3 << 20))
    found = read_table(file)
    assert list(found.column("a")) == [1.0, 2.0]
    assert list(found.left_out) == ["lines of NUL (was the power lost?)"]
    assert sniff(file)[0] == Csv()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"t": [0, 1', "is not readable JSON"),
        ("", "is not readable JSON"),
        ('{"t": 0}\n{"t": \n', "line 2: Expecting value at character"),
        ('{"t": 0}{"t": 1}', "line 1: Extra data at character"),
        ('{"t": 0}\n{"t": 1}{"t": 2}', "line 2: Extra data at character"),
        ("[" * 100_000, "nested too deeply"),
        ('{"a":' * 500 + "1" + "}" * 500, "nested more than 64 deep"),
        ("[" + '{"a":' * 500 + "1" + "}" * 500 + "]", "nested too deeply|not a readable JSON"),
        (b"\xff\xfe\x00", "is not readable JSON"),
        ("[" + "9" * 10_000 + "]", "is not readable JSON"),
    ],
)
def test_malformed_json_is_refused(tmp_path: Path, text: str | bytes, message: str) -> None:
    with pytest.raises(MapFileError, match=message) as error:
        read_table(write(tmp_path, "log.json", text))
    assert len(str(error.value)) < 500


def test_numbers_beyond_all_measure_are_no_numbers(tmp_path: Path) -> None:
    found = read_table(write(tmp_path, "log.json", '{"a": [1, 1' + "0" * 400 + "]}"))
    with pytest.raises(MapFileError, match="'a': value 2 is 1000"):
        found.column("a")


def test_json_that_would_fill_the_memory_is_refused_before_it_is_parsed(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match=r"would take 1\.\d GB as JSON"):
        read_table(write(tmp_path, "log.json", "[" + "{}," * 4_000_000 + "{}]"))


# ------------------------------------------------- npz, Parquet, MATLAB


def npy_header(shape: str, descr: str = "'<f8'") -> bytes:
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


def test_npz(tmp_path: Path) -> None:
    log = np.array([(0.0, 1), (0.1, 2)], dtype=[("t", "f8"), ("a", "i4")])
    np.savez(tmp_path / "d.npz", t=np.arange(5.0), m=np.arange(10).reshape(2, 5), g=9.81, log=log, o=np.array([{}, 1], object))
    found = read_table(tmp_path / "d.npz")
    assert (list(found.column("t")), list(found.column("m[2]"))) == ([0, 1, 2, 3, 4], [5, 6, 7, 8, 9])
    assert (found.scalar("g"), list(found.column("log.a"))) == (9.81, [1.0, 2.0])
    with pytest.raises(MapFileError, match="'o': holds Python objects"):
        found.column("o")


@pytest.mark.parametrize(
    ("member", "message"),
    [
        (npy_header("(1000000000000,)"), "declares 1000000000000 values, more than the file holds"),
        (npy_header("(99999999999999999999, 9999999999999)"), "more than the file holds"),
        (npy_header("(-5,)"), "d.npz"),
        (npy_header("(2,)", "'<f8'") + bytes(15), "more than the file holds|d.npz"),
        (b"nonsense", "is not a readable npz file"),
        (b"\x93NUMPY\x01\x00\x0b\x00{'descr': (", "is not a readable npz file"),
        (npy_header("(1,)", "__import__('os')"), "is not a readable npz file"),
    ],
)
def test_malformed_npz_is_refused(tmp_path: Path, member: bytes, message: str) -> None:
    with zipfile.ZipFile(tmp_path / "d.npz", "w") as archive:
        archive.writestr("a.npy", member)
    with pytest.raises(MapFileError, match=message):
        read_table(tmp_path / "d.npz")


def test_a_zip_bomb_is_refused_before_it_unpacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    np.savez_compressed(tmp_path / "d.npz", t=np.zeros(200_000), a=np.zeros(200_000))
    assert (tmp_path / "d.npz").stat().st_size < 10_000
    monkeypatch.setattr(table, "MAX_NUMBERS", 300_000)
    with pytest.raises(MapFileError, match="to 400000 numbers, expected at most 300000"):
        read_table(tmp_path / "d.npz")


def test_what_unpacks_to_far_more_than_any_recording_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of it is unpacked; noise of the same length, which no archive packs as small, is read."""
    monkeypatch.setattr(table, "FEW_NUMBERS", 100_000)
    np.savez_compressed(tmp_path / "noise.npz", t=np.random.default_rng(1).standard_normal(200_000))
    assert read_table(tmp_path / "noise.npz").column("t").size == 200_000
    np.savez_compressed(tmp_path / "zeros.npz", t=np.zeros(90_000), a=np.zeros(90_000))
    monkeypatch.setattr(np.lib.format, "read_array", lambda *_, **__: pytest.fail("unpacked"))
    with pytest.raises(MapFileError, match="to 180000 numbers, expected at most 100000 in one of this size"):
        read_table(tmp_path / "zeros.npz")


def structs(*rows: dict) -> np.ndarray:
    """A struct array of MATLAB."""
    array = np.empty((1, len(rows)), [(key, object) for key in rows[0]])
    for place, row in enumerate(rows):
        array[0, place] = tuple(row.values())
    return array


@pytest.mark.parametrize(
    ("labels", "names"), [(("q", "p"), ("s.q.values", "s.p.values")), (("q", "q"), ("s[1].values", "s[2].values"))]
)
def test_struct_arrays_of_matlab(tmp_path: Path, labels: tuple[str, str], names: tuple[str, str]) -> None:
    signals = structs(*({"values": np.arange(3.0)[:, None] + i, "label": label} for i, label in enumerate(labels)))
    log = structs({"t": 0.0, "a": 1.0}, {"t": 0.1, "a": np.empty((0, 0))}, {"t": 0.2, "a": 3.0})
    savemat(tmp_path / "d.mat", {"s": signals, "log": log})
    found = read_table(tmp_path / "d.mat")
    assert [list(found.column(name)) for name in names] == [[0.0, 1.0, 2.0], [1.0, 2.0, 3.0]]
    assert found.column("log.a") == pytest.approx([1.0, np.nan, 3.0], nan_ok=True)


def test_a_matlab_variable_that_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    savemat(tmp_path / "d.mat", {"t": np.arange(3.0)})
    packed = zlib.compress(bytes(9_000_000))
    with (tmp_path / "d.mat").open("ab") as stream:
        stream.write(struct.pack("<II", 15, len(packed)) + packed)
    monkeypatch.setattr(table, "MAX_NUMBERS", 1_000_000)
    with pytest.raises(MapFileError, match="unpacks to more than 8000000 bytes"):
        read_table(tmp_path / "d.mat")


@needs_pyarrow
def test_parquet_times_truths_and_what_is_no_number(tmp_path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    columns = {
        "stamp": pyarrow.array([1_700_000_000_000, 1_700_000_000_010], pyarrow.timestamp("ms")),
        "on": [True, None], "list": [[1.0], [2.0]], "n": pyarrow.array([1, None], pyarrow.int32()),
    }  # fmt: skip
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "d.parquet")
    found = read_table(tmp_path / "d.parquet")
    assert list(found.column("stamp") * 1e-9) == pytest.approx([1.7e9, 1.7e9 + 0.01], abs=1e-6)
    assert found.column("on") == pytest.approx([1.0, np.nan], nan_ok=True)
    assert found.column("n") == pytest.approx([1.0, np.nan], nan_ok=True)
    with pytest.raises(MapFileError, match="'list': holds values of type list"):
        found.column("list")


@needs_pyarrow
def test_a_parquet_file_of_many_equal_rows_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import pyarrow
    import pyarrow.parquet

    pyarrow.parquet.write_table(pyarrow.table({"a": np.zeros(100_000)}), tmp_path / "d.parquet")
    monkeypatch.setattr(table, "MAX_NUMBERS", 50_000)
    with pytest.raises(MapFileError, match="'a': brings the file to 100000 numbers, expected at most 50000"):
        read_table(tmp_path / "d.parquet")


def matlab_73(path: Path) -> None:
    """As MATLAB writes it with -v7.3: a header of 512 bytes, dimensions the other way round, classes as attributes."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        def put(name: str, value: np.ndarray, kind: bytes = b"double") -> None:
            file[name] = value
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)

        put("t", np.arange(4.0)[None, :])
        put("gain", np.array([[35.0]]))
        put("log/p", np.arange(8.0).reshape(2, 4))  # 4 x 2 in MATLAB
        put("note", np.array([[104, 105]], np.uint16), b"char")
        file["log/self"] = file["log"]
        file["away"] = h5py.ExternalLink("other.h5", "/t")
        file["soft"] = h5py.SoftLink("/t")
        file.create_dataset("sparse_bomb", shape=(10**11,), chunks=(10**6,), dtype="f8")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM")


@needs_h5py
def test_matlab_73(tmp_path: Path) -> None:
    matlab_73(tmp_path / "d.mat")
    with pytest.raises(MapFileError, match="'sparse_bomb': brings the file to 100000000009 numbers"):
        read_table(tmp_path / "d.mat")
    import h5py

    with h5py.File(tmp_path / "d.mat", "r+") as file:
        del file["sparse_bomb"]
    found = read_table(tmp_path / "d.mat")
    assert (list(found.column("t")), found.scalar("gain")) == ([0, 1, 2, 3], 35.0)
    assert list(found.column("log.p[2]")) == [4, 5, 6, 7]
    for name, what in {"note": "no plain", "away": "a link", "soft": "a link", "log.self": "elsewhere"}.items():
        with pytest.raises(MapFileError, match=f"'{name}': holds .*{what}"):
            found.column(name)


def test_matlab_73_without_h5py_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr("lugre_steering.importing.arrays.importlib.import_module", absent)
    head = b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM"
    with pytest.raises(MapFileError, match=r"needs h5py.*lugre_steering\[import\]"):
        read_table(write(tmp_path, "d.mat", head + bytes(400)))


def damaged(raw: bytes) -> list[bytes]:
    """Cut and flipped copies."""
    rng = np.random.default_rng(1)
    found = [raw[: int(cut)] for cut in rng.integers(0, len(raw), 25)]
    for _ in range(75):
        copy = bytearray(raw)
        for place in rng.integers(0, len(raw), 3):
            copy[place] ^= 1 << int(rng.integers(8))
        found.append(bytes(copy))
    return found


@pytest.mark.parametrize("name", ["d.npz", "d.mat", "d.json", "d.csv"])
def test_damaged_files_are_refused_or_read_but_never_a_traceback(tmp_path: Path, name: str) -> None:
    t, a = np.arange(50.0), np.sin(np.arange(50.0))
    if name == "d.npz":
        np.savez_compressed(tmp_path / name, t=t, a=a)
    elif name == "d.mat":
        savemat(tmp_path / name, {"t": t, "a": a}, do_compression=True)
    elif name == "d.json":
        write(tmp_path, name, json.dumps([{"t": x, "a": y} for x, y in zip(t, a, strict=True)]))
    else:
        text = io.StringIO()
        np.savetxt(text, np.column_stack([t, a]), delimiter=",", header="t,a", comments="")
        write(tmp_path, name, text.getvalue())
    for raw in damaged((tmp_path / name).read_bytes()):
        with suppress(MapFileError):
            read_table(write(tmp_path, f"x{name}", raw)).column("a")


def test_a_line_without_end_and_columns_without_number_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match="line 1: is longer than"):
        read_table(write(tmp_path, "log.csv", "1," * 600_000))
    with pytest.raises(MapFileError, match="line 1: has 20000 columns"):
        read_table(write(tmp_path, "log.csv", ",".join(f"a{i}" for i in range(20_000)) + "\n1\n"))
    with pytest.raises(MapFileError, match="is no regular file"):
        read_table(tmp_path)
    with pytest.raises(MapFileError, match="no such file"):
        read_table(tmp_path / "missing.csv")
