# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Proposed maps: what is guessed for files whose content is known, whether it says so, and that it works."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

from lugre_steering.cli import app
from lugre_steering.errors import MapFileError
from lugre_steering.importing import import_table, load_map, read_table
from lugre_steering.importing.propose import propose
from lugre_steering.importing.sniff import sniff

T = np.arange(0.0, 20.0, 0.01)
ANGLE, RATE = np.radians(30.0) * np.sin(T), np.radians(30.0) * np.cos(T)


def csv_of(folder: Path, columns: dict[str, np.ndarray], delimiter: str = ",", decimal: str = ".") -> Path:
    path = folder / "log.csv"
    rows = [[f"{x:.15g}".replace(".", decimal) for x in row] for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(delimiter.join(row) for row in [list(columns), *rows]) + "\n", encoding="utf-8")
    return path


def proposal(table: Path) -> dict:
    """What is proposed, after importing with it."""
    map_file = table.with_name("map.yaml")
    found = propose(table, map_file)
    assert found["problem"] is None, found["problem"]
    import_table(table, map_file, table.with_name("bag"))
    return found | {"text": map_file.read_text(encoding="utf-8")}


def units(found: dict) -> dict[str, tuple[str, str]]:
    return {guess["key"]: (guess["column"], guess["unit"]) for guess in (*found["clocks"], *found["channels"])}


@pytest.mark.parametrize("angle_unit", ["rad", "deg"])
@pytest.mark.parametrize("rate_unit", ["rad/s", "deg/s"])
@pytest.mark.parametrize(("time_unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6)])
def test_units_are_told_from_numbers_alone(tmp_path: Path, angle_unit: str, rate_unit: str, time_unit: str, factor: float) -> None:
    columns = {
        "time": T * factor,
        "steering_angle": np.degrees(ANGLE) if angle_unit == "deg" else ANGLE,
        "steering_rate": np.degrees(RATE) if rate_unit == "deg/s" else RATE,
        "pressure_1": 120.0 + T, "torque": 900.0 * np.sign(RATE), "ambient_temp": 293.0 + 0.1 * T,
    }  # fmt: skip
    found = proposal(csv_of(tmp_path, columns))
    assert units(found) == {
        "time": ("time", time_unit), "angle/left": ("steering_angle", angle_unit), "rate/left": ("steering_rate", rate_unit),
        "pressure/pressure_1": ("pressure_1", "bar"), "measured_torque": ("torque", "N m"), "air_temperature": ("ambient_temp", "K"),
    }  # fmt: skip
    why = {guess["key"]: guess["why"] for guess in found["channels"]}
    assert "GUESSED" in why["measured_torque"]
    assert "times the angle" in why["rate/left"]
    for reason in why.values():
        assert reason in found["text"]


def test_stated_units_are_taken_and_commands_are_not(tmp_path: Path) -> None:
    columns = {
        "t [ms]": 1e3 * T, "angle left [mrad]": 1e3 * ANGLE, "angle_right_deg": np.degrees(ANGLE), "target angle": ANGLE,
        "Force (kN)": T, "p cap (MPa)": T, "T air [C]": np.full_like(T, 15.0), "motor_enabled": np.ones_like(T), "foo": T[::-1],
    }  # fmt: skip
    found = proposal(csv_of(tmp_path, columns, ";", ","))
    assert units(found) == {
        "time": ("t [ms]", "ms"), "angle/left": ("angle left [mrad]", "mrad"), "angle/right": ("angle_right_deg", "deg"),
        "measured_torque": ("Force (kN)", "kN"), "pressure/cap": ("p cap (MPa)", "MPa"), "air_temperature": ("T air [C]", "degC"),
    }  # fmt: skip
    assert {row["column"] for row in found["unused"]} == {"target angle", "motor_enabled", "foo"}
    assert "the name tells nothing known; 0 ... 19.99" in found["text"]
    assert "csv: {delimiter: ;, decimal: ','}" in found["text"]


def test_a_logger_with_metadata_unit_row_repeated_header_short_rows_and_another_encoding(tmp_path: Path) -> None:
    rows = [f"{10 * i};{str(0.5 * i).replace('.', ',')};{100 + i};" for i in range(60)]
    rows[30:30] = ["Zeit;Lenkwinkel links;Druck A;"]
    rows[40] = rows[40].split(";")[0] + ";1,5"
    head = ["Logger 3000;Version 2", "Datum;22.11.2026", "", "Zeit;Lenkwinkel links;Druck A;", "[ms];[°];[bar];"]
    (tmp_path / "log.csv").write_bytes("\r\n".join([*head, *rows, "Ende der Messung"]).encode("latin-1"))
    found = proposal(tmp_path / "log.csv")
    assert units(found) == {
        "time": ("Zeit", "ms"), "angle/left": ("Lenkwinkel links", "deg"), "pressure/druck_a": ("Druck A", "bar")
    }  # fmt: skip
    options = load_map(tmp_path / "map.yaml").csv
    assert (options.delimiter, options.decimal, options.skip_rows, options.header_rows) == (";", ",", 3, 2)
    assert (options.encoding, options.allow) == ("latin-1", ("short_rows", "text_rows"))
    assert "1 repeated header rows" in found["format"]


def test_names_between_a_row_of_groups_and_one_of_units(tmp_path: Path) -> None:
    head = ["Run 7,,Right side,,,Weather", "Time,Angle left,Angle right,p main A,p main B,T air", "ms,mrad,mrad,kPa,kPa,K"]
    rows = [f"{10 * i},{i % 7},{i % 5},{900 + i},{800 + i},290" for i in range(60)]
    (tmp_path / "log.csv").write_text("\n".join([*head, *rows]))
    found = proposal(tmp_path / "log.csv")
    assert units(found) == {
        "time": ("Time", "ms"), "angle/left": ("Angle left", "mrad"), "angle/right": ("Angle right", "mrad"),
        "pressure/main_a": ("p main A", "kPa"), "pressure/main_b": ("p main B", "kPa"), "air_temperature": ("T air", "K"),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("Logger,DL\nSerial,12345\n\nt [s],angle [deg]\n", "{t:.2f},{a}\n"), ("# t [s];angle [deg]\n", "{t:.2f};{a}\n"),
        ("# t_[s] angle_[deg]\n# s deg\n", "{t:.2f} {a}\n"), ("#,t [s],angle [deg]\n", "7,{t:.2f},{a}\n"),
        ('"t\n[s]","angle\n[deg]"\n', "{t:.2f},{a}\n"), ('Remark,"open\nt [s],angle [deg]\n', "{t:.2f},{a}\n"),
        ("Remark \x85\u2028\x0c.\nt [s],angle [deg]\n", "{t:.2f},{a}\n"),
    ],
)  # fmt: skip
def test_names_below_remarks_in_comments_and_over_several_lines(tmp_path: Path, head: str, row: str) -> None:
    (tmp_path / "log.csv").write_text(head + "".join(row.format(t=0.01 * i, a=i % 7) for i in range(60)), encoding="utf-8")
    found = {key: (name.replace("_", " "), unit) for key, (name, unit) in units(proposal(tmp_path / "log.csv")).items()}
    assert found == {"time": ("t [s]", "s"), "angle/left": ("angle [deg]", "deg")}


def test_a_unit_with_an_open_quote_is_told(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text('t,stroke\ns,"\n' + "".join(f"{0.01 * i:.2f},{i}\n" for i in range(60)))
    with pytest.raises(MapFileError, match="line 2: a cell begins with a quote that its row does not close"):
        propose(tmp_path / "log.csv", tmp_path / "map.yaml")


def test_the_encoding_of_a_large_file(tmp_path: Path) -> None:
    rows = "".join(f"{0.01 * i:.2f},{i % 50}\n" for i in range(120_000))
    for head, foot in (("t,Winkel [°]\n", ""), ("t,Winkel [deg]\n", "# °\n")):
        (tmp_path / "log.csv").write_bytes((head + rows + foot).encode("latin-1"))
        assert sniff(tmp_path / "log.csv")[0].encoding == "latin-1"
        (tmp_path / "log.csv").write_bytes((head + rows + foot).encode("utf-8"))
        assert sniff(tmp_path / "log.csv")[0].encoding == "utf-8"


@pytest.mark.parametrize("commas", [",", ",,,"])
def test_rows_that_end_in_more_commas_than_their_header(tmp_path: Path, commas: str) -> None:
    rows = [f"{0.01 * i:.2f},{i % 7},{100 + i}{commas}" for i in range(60)]
    (tmp_path / "log.csv").write_text("\n".join(["Machine 3", "t [s],angle [deg],p_cap_bar", *rows]))
    found = proposal(tmp_path / "log.csv")
    assert units(found) == {"time": ("t [s]", "s"), "angle/left": ("angle [deg]", "deg"), "pressure/cap": ("p_cap_bar", "bar")}
    assert load_map(tmp_path / "map.yaml").csv.skip_rows == 1


def test_a_stroke_is_told_to_be_no_angle_yet(tmp_path: Path) -> None:
    found = proposal(csv_of(tmp_path, {"t [s]": T, "stroke left [mm]": 200.0 * ANGLE, "p_cap [bar]": 50.0 + T}))
    assert list(units(found)) == ["time", "pressure/cap"]
    assert "a length in mm: by 'pivots' or a 'polynomial' an angle" in found["unused"][0]["why"]


def test_two_clocks_in_one_file(tmp_path: Path) -> None:
    table = tmp_path / "log.csv"
    slow = [f"{0.1 * i:.1f},{100 + i}" if i < 40 else "," for i in range(400)]
    table.write_text("t1,p1 [bar],t2,angle\n" + "".join(f"{a},{0.01 * i:.2f},{10 + 0.1 * i}\n" for i, a in enumerate(slow)))
    proposal(table)
    mapping = load_map(tmp_path / "map.yaml")
    assert (mapping.clock("pressure/p1").column, mapping.clock("angle/left").column) == ("t1", "t2")


def test_unix_time_needs_no_epoch(tmp_path: Path) -> None:
    found = proposal(csv_of(tmp_path, {"stamp": 1.7e12 + np.round(1e3 * T), "angle": ANGLE}))
    assert units(found)["time"] == ("stamp", "ms")
    assert load_map(tmp_path / "map.yaml").epoch_s == 0.0


def test_signed_integers_and_single_numbers(tmp_path: Path) -> None:
    duty = np.round(300 * np.sin(T)).astype(int) & 0xFFFF
    entries = [{"timestamp": t, "position": a, "duty": int(d)} for t, a, d in zip(T, ANGLE, duty, strict=True)]
    (tmp_path / "log.json").write_text(json.dumps({"mass": 0.5, "entries": entries}))
    found = proposal(tmp_path / "log.json")
    assert found["signed"] == {"entries.duty": 16}
    assert "mass = 0.5" in found["text"]


def test_a_table_without_names_is_not_guessed_at(tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_text("".join(f"{10 * i}\t{i % 7}\t{i % 3}\n" for i in range(50)))
    found = propose(tmp_path / "log.txt", tmp_path / "map.yaml")
    assert found["channels"] == []
    assert "expected at least one channel" in found["problem"]
    text = (tmp_path / "map.yaml").read_text()
    assert "header_rows: 0" in text
    assert "#   c2: the name tells nothing known; 0 ... 6" in text


def test_no_column_that_rises_asks_for_a_rate(tmp_path: Path) -> None:
    savemat(tmp_path / "d.mat", {"angle": ANGLE})
    found = propose(tmp_path / "d.mat", tmp_path / "map.yaml")
    assert "key 'time'" in found["problem"]
    text = (tmp_path / "map.yaml").read_text().replace("# time: {rate_Hz: 100}", "time: {rate_Hz: 100}")
    (tmp_path / "map.yaml").write_text(text)
    (row,) = import_table(tmp_path / "d.mat", tmp_path / "map.yaml", tmp_path / "bag")["channels"]
    assert row["rate_Hz"] == pytest.approx(100.0)


def test_names_that_would_break_the_map_do_not(tmp_path: Path) -> None:
    columns = {"time": T, "angle: {x}\n- #'\"left": ANGLE, "odd\nschema: other": T[::-1]}
    (tmp_path / "d.json").write_text(json.dumps({name: list(values) for name, values in columns.items()}))
    found = proposal(tmp_path / "d.json")
    assert units(found)["angle/left"][0] == "angle: {x}\n- #'\"left"


@pytest.mark.parametrize("text", ["", "\0\0\0\0", "only words\nand more\n", "a,b\n", "\n\n\n"])
def test_what_is_no_table_is_refused_and_no_map_is_written(tmp_path: Path, text: str) -> None:
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(MapFileError, match=r"log\.csv"):
        propose(tmp_path / "log.csv", tmp_path / "map.yaml")
    assert not (tmp_path / "map.yaml").exists()


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    table = csv_of(tmp_path, {"time": T, "angle": np.degrees(ANGLE)})
    said = CliRunner().invoke(app, ["import", str(table), "--propose"])
    assert said.exit_code == 0, said.output
    assert "radians would" in said.output
    assert load_map(tmp_path / "log_map.yaml").channels["angle/left"].unit == "deg"
    again = CliRunner().invoke(app, ["import", str(table), "--propose"])
    assert again.exit_code == 2
    assert "exists already" in again.output
    as_json = CliRunner().invoke(app, ["import", str(table), "--propose", "--map", "other.yaml", "--json"])
    assert json.loads(as_json.stdout)["channels"][0]["unit"] == "deg"
    neither = CliRunner().invoke(app, ["import", str(table)])
    assert neither.exit_code == 2
    assert "needs --map FILE and --out DIR; --propose writes a first map" in neither.output


def test_a_stated_unit_that_is_none_of_the_quantity_is_never_taken_for_another(tmp_path: Path) -> None:
    columns = {
        "t": T, "q [rev]": ANGLE / (2.0 * np.pi), "q_des": ANGLE, "torque [mNm]": 1e3 * np.sign(RATE), "p_main_a [mA]": 4.0 + 0.1 * T,
        "p_main_b [kg/cm2]": 100.0 + T,
    }  # fmt: skip
    found = proposal(csv_of(tmp_path, columns))
    assert units(found) == {
        "time": ("t", "s"), "angle/left": ("q [rev]", "rev"), "measured_torque": ("torque [mNm]", "mN m"),
        "pressure/main_b": ("p_main_b [kg/cm2]", "kg/cm2"),
    }  # fmt: skip
    unused = {entry["column"]: entry["why"] for entry in found["unused"]}
    assert "'mA'" in unused["p_main_a [mA]"]
    assert "command" in unused["q_des"]


@pytest.mark.parametrize(
    ("columns", "epoch_s"),
    [
        ({"Date": 45987.25 + T / 86400.0}, 0.0),
        ({"Time": 0.25 + T / 86400.0}, 1e9),
        ({"header.stamp.sec": 1.7e9 + np.floor(T + 0.5), "header.stamp.nanosec": np.round((T + 0.5) % 1.0 * 1e9)}, 0.0),
        ({"timestamp": np.floor(1.7e9 + T)}, 0.0),
        ({"time": np.repeat(T[::2], 2)}, 1e9),
        ({"time_h": T / 3600.0}, 1e9),
        ({"time": 134192231900000000 + 1e7 * T}, 0.0),
        ({"time": 639000000000000000 + 1e7 * T}, 0.0),
        ({"time": 3850000000 + T}, 0.0),
    ],
)
def test_clocks_of_spreadsheets_of_messages_and_of_coarse_stamps(tmp_path: Path, columns: dict[str, np.ndarray], epoch_s: float) -> None:
    found = proposal(csv_of(tmp_path, columns | {"angle": np.degrees(ANGLE)}))
    mapping = load_map(tmp_path / "map.yaml")
    (row,) = import_table(tmp_path / "log.csv", tmp_path / "map.yaml", tmp_path / "bag2")["channels"]
    assert row["rate_Hz"] == pytest.approx(100.0, rel=0.02)
    assert row["to_s"] - row["from_s"] == pytest.approx(19.99, rel=0.02)
    if mapping.time.rate_Hz is None:
        assert mapping.epoch_s == epoch_s
    else:
        assert "stamps repeat the one before: GUESSED 100 rows per second" in found["text"]
        assert mapping.epoch_s == (1.7e9 if "timestamp" in columns else 1e9)


def test_days_of_a_spreadsheet_are_unix_time(tmp_path: Path) -> None:
    propose(csv_of(tmp_path, {"Date": 45987.25 + T / 86400.0, "angle": np.degrees(ANGLE)}), tmp_path / "map.yaml")
    (row,) = import_table(tmp_path / "log.csv", tmp_path / "map.yaml", tmp_path / "bag")["channels"]
    assert row["from_s"] == pytest.approx(datetime(2025, 11, 26, 6, tzinfo=UTC).timestamp(), abs=1e-3)


@pytest.mark.parametrize(
    ("time", "wanted"),
    [
        ({"time [s]": T / 86400.0}, "makes 8.64e+06 samples per second, expected 0.1 to 50000"),
        ({"time": np.repeat(T[::100], np.random.default_rng(1).permutation([20, 180] * 10))}, "many stamps repeat the one before"),
        ({"time": (86395.0 + T) % 86400.0}, "s before it begins"),
        ({"time [s]": np.repeat([0.0, 1.0, 2.0, 1.0, 2.0], 400)[: T.size]}, "many stamps repeat the one before"),
        ({"time": T % 7.0}, "runs back, after which 1301 of 2000 samples are of no use"),
        ({"time": T[::-1]}, "key 'time'"),
        ({"sample": np.arange(T.size)}, "key 'time'"),
        ({"time [ticks]": T}, "key 'time'"),
        ({"time_daq_s": 1.78e9 + T, "p_bar": 100.0 + T, "time_can_s": T}, "key 'epoch_s'"),
    ],
)
def test_a_time_that_cannot_be_is_a_problem(tmp_path: Path, time: dict[str, np.ndarray], wanted: str) -> None:
    found = propose(csv_of(tmp_path, time | {"angle": np.degrees(ANGLE)}), tmp_path / "map.yaml")
    assert wanted in found["problem"]
    assert "nothing known" not in (tmp_path / "map.yaml").read_text()


def written(folder: Path, header: list[str], rows: list[list[str]], delimiter: str = ",") -> Path:
    path = folder / "log.csv"
    path.write_text("\n".join(delimiter.join(row) for row in [header, *rows]) + "\n", encoding="utf-8")
    return path


NOON = datetime(2026, 11, 22, 11, 59, 50, tzinfo=UTC)


def stamps(form: str) -> list[str]:
    return [(NOON + timedelta(seconds=float(t))).strftime(form) for t in T]


@pytest.mark.parametrize(
    ("titles", "forms", "from_s"),
    [
        (["Datum"], ["%d.%m.%Y %H:%M:%S,%f"], NOON.timestamp()),
        (["Timestamp"], ["%m/%d/%Y %I:%M:%S.%f %p"], NOON.timestamp()),
        (["Stamp"], ["%d/%m/%Y %H:%M:%S.%f"], NOON.timestamp()),
        (["Stamp"], ["%d-%m-%Y %H:%M:%S.%f"], NOON.timestamp()),
        (["Time"], ["%H:%M:%S.%f"], 11 * 3600 + 59 * 60 + 50),
        (["Date", "Time"], ["%Y-%m-%d", "%H:%M:%S.%f"], NOON.timestamp()),
        (["Time", "Date"], ["%I:%M:%S.%f %p", "%d.%m.%Y"], NOON.timestamp()),
    ],
)
def test_stamps_of_loggers(tmp_path: Path, titles: list[str], forms: list[str], from_s: float) -> None:
    rows = [list(row) for row in zip(*map(stamps, forms), (f"{x:.4f}" for x in np.degrees(ANGLE)), strict=True)]
    found = proposal(written(tmp_path, [*titles, "angle left"], rows, ";"))
    (row,) = import_table(tmp_path / "log.csv", tmp_path / "map.yaml", tmp_path / "bag2")["channels"]
    assert (row["from_s"], row["to_s"]) == (pytest.approx(from_s, abs=1e-3), pytest.approx(from_s + 19.99, abs=1e-3))
    assert row["samples"] == T.size
    assert ("epoch_s: 0" in found["text"]) == (from_s > 1e8)


@pytest.mark.parametrize(
    ("title", "every_s", "seconds", "rate_Hz"),
    [("Time [hh:mm:ss]", 1.0, 200, 1.0), ("Time", 0.5, 100, 2.0), ("Uhrzeit", 0.1, 20, 10.0), ("Time", 0.01, 3, 100.0)],
)
def test_times_of_the_day_are_seconds(tmp_path: Path, title: str, every_s: float, seconds: int, rate_Hz: float) -> None:
    form = "%H:%M:%S.%f" if every_s == 0.5 else "%H:%M:%S"
    rows = [[(NOON + timedelta(seconds=i * every_s)).strftime(form), f"{i % 90}"] for i in range(round(seconds / every_s))]
    proposal(written(tmp_path, [title, "angle left"], rows))
    (row,) = import_table(tmp_path / "log.csv", tmp_path / "map.yaml", tmp_path / "bag2")["channels"]
    assert row["rate_Hz"] == pytest.approx(rate_Hz)


def test_a_column_that_only_rises_is_guessed_to_be_the_time(tmp_path: Path) -> None:
    found = propose(csv_of(tmp_path, {"foo": T, "angle": ANGLE}), tmp_path / "map.yaml")
    assert found["clocks"][0]["why"].startswith("GUESSED: the first column that only rises")


def test_a_time_is_in_a_guessed_unit_where_another_could_be(tmp_path: Path) -> None:
    found = propose(csv_of(tmp_path, {"time": np.arange(200.0), "angle": np.arange(200.0)}), tmp_path / "map.yaml")
    assert "GUESSED: steps of 1: 1000 samples per second; if not, then s" in found["clocks"][0]["why"]


def test_dates_whose_order_nothing_tells_are_left_to_the_user(tmp_path: Path) -> None:
    rows = [[f"05/06/2026 10:00:{i:02}", f"{i}"] for i in range(60)]
    found = propose(written(tmp_path, ["Date", "angle left"], rows), tmp_path / "map.yaml")
    assert found["problem"] is not None
    assert "dates like '05/06/2026 10:00:00' are ambiguous: say csv.dates: dmy or mdy" in found["format"]
    rows = [[f"05/06/2026 10:00:{i:02} AM", f"{i}"] for i in range(60)]
    (tmp_path / "map.yaml").unlink()
    found = proposal(written(tmp_path, ["Date", "angle left"], rows))
    assert any("GUESSED mdy" in reason for reason in found["format"])


def test_numpy_dates(tmp_path: Path) -> None:
    time = np.datetime64("2026-11-22T06:00:00", "ms") + np.round(1e3 * T).astype("timedelta64[ms]")
    np.savez(tmp_path / "d.npz", stamp=time, angle=np.degrees(ANGLE))
    assert units(proposal(tmp_path / "d.npz"))["time"] == ("stamp", "ns")
    (row,) = import_table(tmp_path / "d.npz", tmp_path / "map.yaml", tmp_path / "bag2")["channels"]
    assert row["from_s"] == pytest.approx(datetime(2026, 11, 22, 6, tzinfo=UTC).timestamp(), abs=1e-3)


@pytest.mark.parametrize("end", ["", ",,,,"])
@pytest.mark.parametrize("turn", [0, 9])
def test_two_rates_in_one_table(tmp_path: Path, end: str, turn: int) -> None:
    lines = ["t [s],angle left [deg],angle right [deg],p_a [bar],p_b [bar],p_c [bar],p_d [bar]"]
    lines += [f"{0.01 * i:.2f},{i % 7},{i % 5}" + (f",{i},{i},{i},{i}" if i % 10 == turn else end) for i in range(600)]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    proposal(tmp_path / "log.csv")
    found = import_table(tmp_path / "log.csv", tmp_path / "map.yaml", tmp_path / "bag2")["channels"]
    assert {row["channel"]: row["samples"] for row in found} == {
        "angle/left": 600, "angle/right": 600, **{f"pressure/p_{line}": 60 for line in "abcd"}
    }  # fmt: skip


def test_tabs_beside_names_with_blanks(tmp_path: Path) -> None:
    found = proposal(csv_of(tmp_path, {"Time [s]": T, "Angle left [deg]": ANGLE, "Pressure main a [bar]": T}, "\t"))
    assert units(found)["pressure/main_a"] == ("Pressure main a [bar]", "bar")


def test_dashes_and_question_marks_are_missing_numbers_and_no_units(tmp_path: Path) -> None:
    rows = [[f"{0.01 * i:.2f}", {1: "-", 2: "---"}.get(i % 10, f"{i % 7}"), "?" if i == 5 else f"{i}"] for i in range(600)]
    found = proposal(written(tmp_path, ["t", "angle left", "p_main_a"], [["s", "-", "bar"], *rows]))
    assert "121 cells of '-', '?', '#N/A' and the like (count as missing)" in found["format"]
    assert units(found)["pressure/main_a"] == ("p_main_a", "bar")
    missing = import_table(tmp_path / "log.csv", tmp_path / "map.yaml", tmp_path / "bag2")["channels"]
    assert [row["missing"] for row in missing] == [120, 1]


@pytest.mark.parametrize(
    ("names", "line"),
    [
        (["angle.left", "pressure.main_a"], "main_a"), (["log.angle.left", "log.p.main_a"], "main_a"),
        (["out.angle_left.signals.values", "out.p_main_a.signals.values"], "main_a"), (["SteerAngleLeft", "PressMainA"], "main_a"),
        (["/steering/left/joint_state/position", "/steering/pressure/main_a/fluid_pressure"], "main_a"), (["Left", "P1"], "p1"),
        (["Left Angle", "Main A Pressure"], "main_a"), (["status.angle left", "left cap pressure"], "left_cap"),
        (["angle_l [0.01 deg]", "p_cap_bar"], "cap"),
    ],
)  # fmt: skip
def test_names_of_sides_and_lines_in_paths_and_words(tmp_path: Path, names: list[str], line: str) -> None:
    found = proposal(csv_of(tmp_path, {"time": T, names[0]: np.degrees(ANGLE), names[1]: 100.0 + T}))
    assert {key: column for key, (column, _) in units(found).items()} == {
        "time": "time", "angle/left": names[0], f"pressure/{line}": names[1]
    }  # fmt: skip


def test_a_command_anywhere_in_a_path_and_a_state_at_its_end_are_nothing_measured(tmp_path: Path) -> None:
    columns = {"time": T, "cmd.angle.left": ANGLE, "angle.left.valid": T, "Left": T, "angle.left": np.degrees(ANGLE)}
    found = proposal(csv_of(tmp_path, columns))
    assert units(found)["angle/left"] == ("angle.left", "deg")
    unused = {row["column"]: row["why"] for row in found["unused"]}
    assert "command" in unused["cmd.angle.left"]
    assert "command" in unused["angle.left.valid"]
    assert "may be angle/left too" in unused["Left"]


@pytest.mark.parametrize(
    ("delimiter", "form", "top"),
    [
        (",", lambda x: f'"{x:.4f}"'.replace(".", ","), "19,9900"), (",", lambda x: f'"{1e6 + x:,.2f}"', "1,000,019.99"),
        (";", lambda x: f"{1e6 + x:,.2f}".translate(str.maketrans(".,", ",.")), "1.000.019,99"),
    ],
)  # fmt: skip
def test_commas_in_quotes_and_thousands_in_groups(tmp_path: Path, delimiter: str, form: Callable[[float], str], top: str) -> None:
    rows = [[form(t), form(angle)] for t, angle in zip(T, np.degrees(ANGLE), strict=True)]
    assert rows[-1][0].strip('"') == top
    proposal(written(tmp_path, ["t", "angle left"], rows, delimiter))
    (row,) = import_table(tmp_path / "log.csv", tmp_path / "map.yaml", tmp_path / "bag2")["channels"]
    assert row["rate_Hz"] == pytest.approx(100.0)
    assert (row["missing"], row["to_s"] - row["from_s"]) == (0, pytest.approx(19.99))


def test_one_group_of_three_digits_is_no_number(tmp_path: Path) -> None:
    rows = [[f"{0.01 * i:.2f}", f"{i}", f'"1,{i:03}"'] for i in range(60)]
    found = proposal(written(tmp_path, ["t", "angle left", "p_main_a"], rows))
    assert {row["column"]: row["why"][:42] for row in found["unused"]} == {"p_main_a": "line 2, column 'p_main_a': got '1,000', ex"}


def test_what_stands_in_round_brackets_is_a_line_or_not_known(tmp_path: Path) -> None:
    columns = {"t": T, "angle (right)": np.degrees(ANGLE), "angle (ref)": ANGLE, "Pressure (A)": 100.0 + T, "torque (ozin)": RATE}
    found = proposal(csv_of(tmp_path, columns))
    assert units(found)["pressure/pressure"] == ("Pressure (A)", "bar")
    assert units(found)["angle/right"] == ("angle (right)", "deg")
    assert "angle/left" not in units(found)
    torque = next(guess for guess in found["channels"] if guess["key"] == "measured_torque")
    assert torque["why"].endswith("; what 'ozin' says is not known")


def test_a_position_beside_a_force_is_guessed_to_be_of_a_linear_axis(tmp_path: Path) -> None:
    found = proposal(csv_of(tmp_path, {"time": T, "position": 500.0 * ANGLE, "force": 100.0 * np.sign(RATE)}))
    assert units(found)["angle/left"] == ("position", "mm")
    assert "GUESSED: up to 261.8 and a force in the file, so a linear axis; if not, then deg" in found["text"]


@pytest.mark.parametrize(
    ("name", "begin", "wanted"),
    [("log.csv.gz", b"\x1f\x8b\x08", "unpack it"), ("log.xlsx", b"PK\x03\x04", "save it as CSV"), ("a.npy", b"\x93NUMPY\x01", r"as \.npz")],
)
def test_tables_that_are_no_text_are_told_what_to_do(tmp_path: Path, name: str, begin: bytes, wanted: str) -> None:
    (tmp_path / name).write_bytes(begin + bytes(100))
    with pytest.raises(MapFileError, match=wanted):
        propose(tmp_path / name, tmp_path / "map.yaml")
    with pytest.raises(MapFileError, match=wanted):
        read_table(tmp_path / name)


TIME_ANGLE = {"time_s": T, "angle_left_deg": np.degrees(ANGLE)}
DIGITS = 1 << 16


@pytest.mark.parametrize(
    ("columns", "key", "wanted"),
    [
        ({"latitude_deg": T, "heading [deg]": T, "wheel_angle_deg": T} | TIME_ANGLE, "angle/left", ("angle_left_deg", "deg")),
        (TIME_ANGLE | {"gyro_z_deg_s": T, "angle_left_rate": RATE}, "rate/left", ("angle_left_rate", "rad/s")),
        (TIME_ANGLE | {"engine_torque_Nm": T, "steer_torque_Nm": RATE}, "measured_torque", ("steer_torque_Nm", "N m")),
        (TIME_ANGLE | {"engine_rpm": 1500.0 + T, "vehicle_speed_mps": T, "vehicle_speed": T}, "rate/left", None),
        (TIME_ANGLE | {"vehicle_speed": T, "gyro": RATE}, "rate/left", ("gyro", "rad/s")),
        ({"t": T, "pitch [deg]": ANGLE}, "angle/left", None),
        ({"t": T, "yaw_angle": T, "joint_angle_deg": ANGLE}, "angle/left", ("joint_angle_deg", "deg")),
        ({"t": T, "wheel_angle_deg": T, "angle_right_deg": T}, "angle/left", None),
        ({"t": T, "angle_left": np.round(1e4 * RATE) % DIGITS}, "angle/left", ("angle_left", "0.01 deg")),
        ({"t": T, "angle_left": np.round(np.degrees(ANGLE)) % DIGITS, "rate_left": np.round(9.55 * RATE) % DIGITS},
         "rate/left", ("rate_left", "rpm")),
        ({"t": T, "p_raw": np.round(500.0 * ANGLE) % DIGITS}, "pressure/raw", ("p_raw", "bar")),
        ({"t": T, "angle_left_cdeg": np.round(1e4 * ANGLE) / 2.0}, "angle/left", ("angle_left_cdeg", "0.01 deg")),
        ({"t": T, "p_main": 180.0 + T, "p_tank": 2.0 + 0.01 * T}, "pressure/tank", ("p_tank", "bar")),
        ({"t": T, "angle_left": np.degrees(ANGLE), "angle_right": 6.0 * ANGLE}, "angle/right", ("angle_right", "deg")),
        ({"t": T, "theta_left_m": np.degrees(ANGLE)}, "angle/left", ("theta_left_m", "deg")),
        ({"t": T, "position_m": 20.0 * ANGLE, "force_N": RATE}, "angle/left", ("position_m", "m")),
        ({"t": T, "cylinder_position_left_mm": 200.0 * ANGLE}, "angle/left", None),
        ({"angle": T, "x": T}, "time", ("x", "s")),
        ({"t": T, "air_temp_F": 70.0 + T}, "air_temperature", ("air_temp_F", "degF")),
        ({"t": T, "air": 9.0 + 0.1 * T}, "air_temperature", ("air", "degC")),
        ({"t": T, "air": 900.0 + T}, "air_temperature", None),
    ],
)  # fmt: skip
def test_which_column_and_unit_are_proposed(
    tmp_path: Path, columns: dict[str, np.ndarray], key: str, wanted: tuple[str, str] | None
) -> None:
    found = propose(csv_of(tmp_path, columns), tmp_path / "map.yaml")
    assert units(found).get(key) == wanted
    if wanted is not None:
        assert found["problem"] is None


@pytest.mark.parametrize("columns", [{"angle_left": np.round(1e4 * ANGLE)}, {"angle": ANGLE, "air temperature": T}])
def test_units_that_nothing_states_are_marked_as_guessed(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    found = propose(csv_of(tmp_path, {"t": T} | columns), tmp_path / "map.yaml")
    assert all("GUESSED" in guess["why"] for guess in found["channels"])


def test_units_that_structures_and_attributes_state(tmp_path: Path) -> None:
    parts = {
        "t": {"unit": "ms", "data": 1e3 * T}, "p_main_a": {"unit": "psi", "time": T, "data": 900.0 + T},
        "angle_left": {"Units": "deg", "values": ANGLE},
    }  # fmt: skip
    savemat(tmp_path / "log.mat", parts)
    (tmp_path / "log.json").write_text(json.dumps(parts, default=list))
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"], file["p_main_a"], file["angle_left"] = 1e3 * T, 900.0 + T, ANGLE
        for name, unit in (("t", "ms since 1970-01-01"), ("p_main_a", "psi"), ("angle_left", np.bytes_("deg"))):
            file[name].attrs["units"] = unit
    for ending in ("mat", "json", "h5"):
        found = propose(tmp_path / f"log.{ending}", tmp_path / f"{ending}.yaml")
        assert found["problem"] is None
        assert found["clocks"][0]["why"] == "named so; unit as stated"
        assert {guess["key"]: guess["unit"] for guess in found["channels"]} == {"pressure/main_a": "psi", "angle/left": "deg"}
        assert not any("unit" in row["column"] for row in found["unused"])
