# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Import of tables: numbers that go in are looked for in the bag by an independent reader; every mistake is named."""

from __future__ import annotations

import importlib.util
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat
from typer.testing import CliRunner

from lugre_steering.bag import read_recording
from lugre_steering.cli import app
from lugre_steering.errors import MapFileError
from lugre_steering.importing import import_table, load_map, read_table
from lugre_steering.importing import write as importing_write
from lugre_steering.importing.channels import outliers
from lugre_steering.importing.map import READABLE_UNITS, Csv, to_si
from lugre_steering.vehicle import load

VEHICLE = Path(__file__).resolve().parents[1] / "config" / "test_vehicle.yaml"
HEAD = "schema: lugre_steering/import/1\n"


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def messages(bag: Path) -> dict[str, list]:
    """Topic -> messages, by the rosbags library."""
    found: dict[str, list] = {}
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, _, raw in reader.messages():
            found.setdefault(connection.topic, []).append(reader.deserialize(raw, connection.msgtype))
    return found


def logged(bag: Path) -> list[tuple[int, str]]:
    """Log time and topic of every message."""
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        return [(log, connection.topic) for connection, log, _ in reader.messages()]


def seconds(message) -> float:
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


@pytest.mark.parametrize(
    ("unit", "one"),
    [
        ("deg", np.pi / 180), ("mrad", 1e-3), ("mm", 1e-3), ("cm", 1e-2), ("bar", 1e5), ("mbar", 100.0), ("kPa", 1e3),
        ("MPa", 1e6), ("psi", 0.45359237 * 9.80665 / 0.0254**2), ("kN", 1e3), ("kN m", 1e3), ("ms", 1e-3), ("us", 1e-6),
        ("ns", 1e-9), ("min", 60.0), ("h", 3600.0), ("rpm", 2 * np.pi / 60), ("deg/s", np.pi / 180), ("mm/s", 1e-3), ("K", 1.0 - 273.15),
        ("rad", 1.0), ("m", 1.0), ("Pa", 1.0), ("N", 1.0), ("N m", 1.0), ("s", 1.0), ("rad/s", 1.0), ("m/s", 1.0), ("degC", 1.0),
        ("d", 86400.0), ("0.1 deg", np.pi / 1800), ("0.01 deg", np.pi / 18000), ("rev", 2 * np.pi), ("um", 1e-6), ("in", 0.0254),
        ("kg/cm2", 9.80665e4), ("lbf", 0.45359237 * 9.80665), ("mN m", 1e-3), ("lbf ft", 0.45359237 * 9.80665 * 0.3048),
        ("lbf in", 0.45359237 * 9.80665 * 0.0254), ("degF", (1.0 - 32.0) / 1.8),
    ],
)  # fmt: skip
def test_a_unit_is_what_its_definition_says(unit: str, one: float) -> None:
    assert to_si(np.ones(1), unit)[0] == pytest.approx(one, rel=1e-12)


def test_every_unit_is_tested_above() -> None:
    marks = test_a_unit_is_what_its_definition_says.pytestmark[0].args[1]
    assert {unit for unit, _ in marks} == set(READABLE_UNITS)


def test_csv_with_two_clocks_units_rate_and_an_epoch(tmp_path: Path) -> None:
    table = write(
        tmp_path,
        "log.csv",
        "# a comment\nt_ms, angle, rate, tp, p1, note\n"
        "0,10,1,0.5,100,first\n10,20,,1.0,200,\n20,30,3,,,\n30,,4,2.0,400,last\n",
    )
    map_file = write(
        tmp_path,
        "map.yaml",
        HEAD + "time: {column: t_ms, unit: ms}\nepoch_s: 1.5e9\nchannels:\n"
        "  angle/right: {column: angle, unit: deg, scale: -1.0, offset: 1.0}\n"
        "  rate/right: {column: rate, unit: deg/s}\n"
        "  pressure/main_a: {column: p1, unit: bar, time: {column: tp}}\n",
    )
    result = import_table(table, map_file, tmp_path / "bag")
    found = messages(tmp_path / "bag")
    angles, pressures = found["/steering/right/joint_state"], found["/steering/pressure/main_a"]
    assert [m.name for m in angles] == [["right_track_steer_joint"]] * 3
    assert np.degrees([m.position[0] for m in angles]) == pytest.approx([-9.0, -19.0, -29.0])
    assert np.degrees([m.velocity[0] for m in angles]) == pytest.approx([1.0, np.nan, 3.0], nan_ok=True)
    assert [round((seconds(m) - 1.5e9) * 1e3) for m in angles] == [0, 10, 20]
    assert [m.fluid_pressure for m in pressures] == pytest.approx([1e7, 2e7, 4e7])
    assert [round(seconds(m) - 1.5e9, 3) for m in pressures] == [0.5, 1.0, 2.0]
    rows = {row["channel"]: row for row in result["channels"]}
    assert rows["angle/right"]["missing"] == 1
    assert (rows["rate/right"]["samples"], rows["rate/right"]["missing"], rows["rate/right"]["unit"]) == (2, 1, "rad/s")
    assert rows["angle/right"]["rate_Hz"] == pytest.approx(100.0)
    assert rows["pressure/main_a"]["samples"] == 3


def test_semicolons_decimal_commas_and_rows_above_the_header(tmp_path: Path) -> None:
    table = write(tmp_path, "log.csv", "Logger 3000\n;;\nt;T\n0,5;293,15\n1,5;303,15\n")
    text = "time: {column: t}\ncsv: {delimiter: ';', decimal: ',', skip_rows: 1}\n"
    map_file = write(tmp_path, "map.yaml", HEAD + text + "channels: {air_temperature: {column: T, unit: K}}\n")
    import_table(table, map_file, tmp_path / "bag")
    found = messages(tmp_path / "bag")["/steering/ambient_temperature"]
    assert [m.temperature for m in found] == pytest.approx([20.0, 30.0])


def test_a_point_is_no_decimal_comma(tmp_path: Path) -> None:
    table = read_table(write(tmp_path, "log.csv", "t;a\n0;1.234\n"), Csv(delimiter=";", decimal=","))
    with pytest.raises(MapFileError, match=r"line 2, column 'a': got '1\.234', expected a number"):
        table.column("a")


def test_numbers_as_loggers_write_them(tmp_path: Path) -> None:
    cells = ["1", "+1.", "-.5", "1e3", "2.5E-04", "NaN", "-nan", "", "N/A", "-inf"]
    table = read_table(write(tmp_path, "log.csv", "t,a\n" + "".join(f"0,{cell}\n" for cell in cells)))
    wanted = [1.0, 1.0, -0.5, 1e3, 2.5e-4, np.nan, np.nan, np.nan, np.nan, -np.inf]
    np.testing.assert_array_equal(table.column("a"), wanted)


def test_polynomial_of_a_stroke_and_force_of_a_cylinder(tmp_path: Path) -> None:
    stroke, cap, rod = np.array([0.0, 10.0, 20.0]), np.array([50.0, 60.0, 70.0]), np.array([5.0, 6.0, 7.0])
    savemat(tmp_path / "d.mat", {"log": {"t": np.arange(3.0), "stroke": stroke, "p": np.column_stack([cap, rod])}})
    map_file = write(
        tmp_path,
        "map.yaml",
        HEAD + "time: {column: log.t}\nchannels:\n"
        "  angle/left: {of: log.stroke, polynomial: [1.0, 2.0, 0.5], unit: deg}\n"
        "  measured_torque:\n    cylinder:\n      cap: {column: 'log.p[1]', unit: bar, area_m2: 0.006}\n"
        "      rod: {column: 'log.p[2]', unit: bar, area_m2: 0.004}\n      arm_m: 0.5\n",
    )
    result = import_table(tmp_path / "d.mat", map_file, tmp_path / "bag", "sqlite3")
    found = messages(tmp_path / "bag")
    angle = [m.position[0] for m in found["/steering/left/joint_state"]]
    assert np.degrees(angle) == pytest.approx([1.0, 71.0, 241.0])
    torque = [m.wrench.torque.z for m in found["/steering/measured_torque"]]
    assert torque == pytest.approx([0.5 * (0.006 * a - 0.004 * b) * 1e5 for a, b in zip(cap, rod, strict=True)])
    assert [row["unit"] for row in result["channels"]] == ["rad", "N m"]


def test_scalar_of_the_file_start_and_stop(tmp_path: Path) -> None:
    savemat(tmp_path / "d.mat", {"t": np.arange(10.0)[:, None], "v": np.arange(10.0)[:, None], "gain": 35.0})
    text = "time: {column: t}\nstart_s: 2.5\nstop_s: 5.0\n"
    channel = "channels: {measured_torque: {column: v, scale: 2.0, scale_by: gain, unit: N}}\n"
    result = import_table(tmp_path / "d.mat", write(tmp_path, "map.yaml", HEAD + text + channel), tmp_path / "bag")
    found = messages(tmp_path / "bag")["/steering/measured_torque"]
    assert [m.wrench.torque.z for m in found] == pytest.approx([210.0, 280.0, 350.0])
    assert result["channels"][0]["outside_start_stop"] == 7


def test_a_cell_array_that_nobody_asks_for_is_no_obstacle(tmp_path: Path) -> None:
    cells = np.empty(2, object)
    cells[:] = [{"name": "run"}, np.arange(3.0)]
    savemat(tmp_path / "d.mat", {"t": np.arange(3.0), "a": np.arange(3.0), "notes": cells})
    assert list(read_table(tmp_path / "d.mat").column("a")) == [0.0, 1.0, 2.0]


@pytest.mark.skipif(importlib.util.find_spec("pyarrow") is None, reason="pyarrow is not installed")
def test_parquet(tmp_path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    columns = {"t": [0.0, 0.1, None], "p": [1, 2, 3], "text": ["a", "b", "c"]}
    pyarrow.parquet.write_table(pyarrow.table(columns), tmp_path / "d.parquet")
    map_file = write(tmp_path, "map.yaml", HEAD + "time: {column: t}\nchannels: {pressure/x: {column: p, unit: MPa}}\n")
    result = import_table(tmp_path / "d.parquet", map_file, tmp_path / "bag")
    assert [m.fluid_pressure for m in messages(tmp_path / "bag")["/steering/pressure/x"]] == [1e6, 2e6]
    assert result["channels"][0]["missing"] == 1


def test_parquet_without_pyarrow_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr("lugre_steering.importing.arrays.importlib.import_module", absent)
    with pytest.raises(MapFileError, match=r"d\.parquet: needs pyarrow.*lugre_steering\[import\]"):
        read_table(write(tmp_path, "d.parquet", "x"))


GOOD = HEAD + "time: {column: t}\nchannels: {angle/left: {column: a, unit: deg}}\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("schema: other\n", "key 'schema': got 'other'"),
        (HEAD + "channels: {}\n", "key 'channels': got {}"),
        (GOOD + "chanels: {}\n", "key 'chanels'.*did you mean 'channels'"),
        (GOOD.replace("unit: deg", "unit: bar"), r"key 'channels.angle/left.unit': got 'bar', expected one of rad, mrad, deg"),
        (GOOD.replace(", unit: deg", ""), r"channels.angle/left.unit': got nothing"),
        (GOOD.replace("column: a", "colum: a"), "colum'.*did you mean 'column'"),
        (GOOD.replace("angle/left", "angle/middle"), "got 'angle/middle', expected angle/left"),
        (GOOD.replace("angle/left", "pressure"), "got 'pressure', expected angle/left"),
        (GOOD.replace("column: a,", "column: a, polynomial: [1.0], of: a,"), "exactly one of column, polynomial, expression"),
        (GOOD.replace("column: a,", "polynomial: [1.0],"), "angle/left.of': got nothing"),
        (GOOD.replace("time: {column: t}\n", ""), "key 'time': got nothing"),
        (GOOD.replace("column: t", "column: t, unit: m"), "key 'time.unit': got 'm'"),
        (GOOD.replace("column: a", "column: a, scale: 2 deg"), "scale': got '2 deg', expected a plain number"),
        (GOOD + "start_s: 2\nstop_s: 1\n", "key 'stop_s': got 1.0, expected more than start_s"),
        (GOOD + "epoch_s: -1\n", "key 'epoch_s': got -1"),
        (GOOD + "csv: {delimiter: ';;'}\n", "key 'csv.delimiter'"),
        (GOOD + "csv: {dates: ymd}\n", "key 'csv.dates': got 'ymd', expected one of dmy, mdy"),
        (GOOD.replace("}}", "}, rate/left: {column: b, unit: m/s}}"), "rate/left.unit': got 'm/s', expected one of rad/s"),
        (GOOD.replace("angle/left: {column: a, unit: deg}", "rate/left: {column: a, unit: deg/s}"), "expected angle/left beside"),
        (GOOD.replace("column: a, unit: deg", "cylinder: {cap: {column: a, unit: bar, area_m2: 1}}"), "for measured_torque only"),
        (GOOD.replace("column: a", "of: a, polynomial: []"), "angle/left.polynomial': got \\[\\], expected at least one"),
        (
            HEAD + "channels: {rate/left: {column: b, unit: deg/s, time: {column: t}}, angle/left: {column: a, unit: deg}}\n",
            "key 'time': got nothing, expected this section, or channels.angle/left.time",
        ),
        (HEAD + "time: {column: t}\nchannels: {pressure/a b: {column: a, unit: bar}}\n", "got 'pressure/a b', expected angle/left"),
        ("[1, 2", "is not valid YAML"),
        ("- 1\n", "expected a mapping"),
    ],
)  # fmt: skip
def test_mistakes_in_the_map_are_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(MapFileError, match=message) as error:
        load_map(write(tmp_path, "map.yaml", text))
    assert "map.yaml" in str(error.value)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("t,b\n0,1\n", r"no column 'a'; there are: t, b \(key 'channels\.angle/left' of the map\)"),
        ("x,a\n0,1\n", r"no column 't'; there are: x, a \(key 'time' of the map\)"),
        ("t;a\n0;1\n", r"no column 'a'; there are: none; without numbers: t;a \(line 2, .* got '0;1', .*\); is csv\.delimiter right\?"),
        ("t,A\n0,1\n", "no column 'a'"),
        ("t,a\n0,1\n1,x\n", "line 3, column 'a': got 'x', expected a number"),
        ("t,a\n0,1\n1,1_0\n", "line 3, column 'a': got '1_0', expected a number"),
        ("t,a\n0,1\n1\n", "line 3: has 1 cells, expected 2"),
        ("t,a,a\n0,1,1\n", "column 'a' occurs twice"),
        ("t,a\n", "has 1 rows"),
        ("", "has 0 rows"),
        ("t,a\n0,\n1,\n", "channel angle/left: no sample is left"),
        ("t,a\n-2e9,1\n", "key 'epoch_s'"),
        ("t,a\n0,\x00\xff\n", "log.csv"),
    ],
)
def test_mistakes_in_the_table_are_named_and_leave_nothing_behind(tmp_path: Path, table: str, message: str) -> None:
    log, map_file = write(tmp_path, "log.csv", table), write(tmp_path, "map.yaml", GOOD)
    with pytest.raises(MapFileError, match=message):
        import_table(log, map_file, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()


def test_columns_of_different_length_are_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "d.mat", {"t": np.arange(5.0), "a": np.arange(4.0)})
    with pytest.raises(MapFileError, match="angle/left: has 4 values, expected 5 as in the column 't'"):
        import_table(tmp_path / "d.mat", write(tmp_path, "map.yaml", GOOD), tmp_path / "bag")


@pytest.mark.parametrize("name", ["d.mat", "d.parquet"])
def test_damaged_binary_files_are_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"MATLAB 5.0 MAT-file" + bytes(range(256)) * 3)
    with pytest.raises(MapFileError, match=name):
        read_table(tmp_path / name)


def test_a_bag_is_never_overwritten(tmp_path: Path) -> None:
    log, map_file = write(tmp_path, "log.csv", "t,a\n0,1\n1,2\n"), write(tmp_path, "map.yaml", GOOD)
    arguments = ["import", str(log), "--map", str(map_file), "--out", str(tmp_path / "bag")]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert CliRunner().invoke(app, arguments).exit_code == 2


def test_the_command_prints_json_and_finds_gaps_and_outliers(tmp_path: Path) -> None:
    time = np.concatenate([np.arange(0.0, 2.0, 0.01), np.arange(3.0, 5.0, 0.01)])
    value = 10.0 * np.sin(time)
    value[[50, 300]] += (8.0, -8.0)
    rows = "".join(f"{t:.3f},{a:.6f}\n" for t, a in zip(time, value, strict=True))
    log, map_file = write(tmp_path, "log.csv", "t,a\n" + rows), write(tmp_path, "map.yaml", GOOD)
    result = CliRunner().invoke(
        app, ["import", str(log), "--map", str(map_file), "--out", str(tmp_path / "bag"), "--json"]
    )
    assert result.exit_code == 0, result.output
    (row,) = json.loads(result.stdout)["channels"]
    assert row["gaps_s"] == [[pytest.approx(1.99), pytest.approx(3.0)]]
    assert row["outliers_s"] == pytest.approx([time[50], time[300]])
    assert row["samples"] == 400


def test_two_runs_in_one_table_are_not_mixed_into_one(tmp_path: Path) -> None:
    """Where the time of the table runs back, a reader of the bag sees a clock that was set back."""
    once = np.arange(0.0, 5.0, 0.01)
    time, value = np.concatenate([once, once + 0.005]), np.concatenate([0.1 * once, 0.5 - 0.1 * once])
    rows = "".join(f"{t:.3f},{a:.6f}\n" for t, a in zip(time, value, strict=True))
    log, map_file = write(tmp_path, "log.csv", "t,a\n" + rows), write(tmp_path, "map.yaml", GOOD)
    (row,) = import_table(log, map_file, tmp_path / "bag")["channels"]
    assert row["not_increasing"] == 1
    found = messages(tmp_path / "bag")["/steering/left/joint_state"]
    assert [m.position[0] for m in found] == pytest.approx(np.radians(value).tolist(), abs=1e-7)
    channels = [channel for channel in load(VEHICLE).channels if channel.name == "left"]
    recording = read_recording(tmp_path / "bag", channels)
    assert recording.angle["left"].value[:499] == pytest.approx(np.radians(0.1 * once[:499]), abs=1e-7)
    assert sum(recording.rejected["/steering/left/joint_state"].values()) == row["unusable"] >= once.size - 2


def test_one_wild_time_costs_one_sample(tmp_path: Path) -> None:
    time = np.arange(0.0, 10.0, 0.01)
    time[200] = 1e5
    rows = "".join(f"{t:.3f},{a:.6f}\n" for t, a in zip(time, np.arange(1000) * 1e-3, strict=True))
    log, map_file = write(tmp_path, "log.csv", "t,a\n" + rows), write(tmp_path, "map.yaml", GOOD)
    import_table(log, map_file, tmp_path / "bag")
    channels = [channel for channel in load(VEHICLE).channels if channel.name == "left"]
    assert read_recording(tmp_path / "bag", channels).angle["left"].value.size == 999


def test_runs_of_channels_at_different_rates_stay_together(tmp_path: Path) -> None:
    """Log times where the table's time has run back: a sample of both channels lies where its row does."""
    t = np.tile(np.arange(0.0, 5.0, 0.01), 2)
    rows = "".join(f"{x:.3f},{x:.4f},{'' if i % 5 else '7'}\n" for i, x in enumerate(t))
    text = HEAD + "time: {column: t}\nchannels:\n  angle/left: {column: a, unit: rad}\n  pressure/main_a: {column: p, unit: bar}\n"
    log, map_file = write(tmp_path, "log.csv", "t,a,p\n" + rows), write(tmp_path, "map.yaml", text)
    import_table(log, map_file, tmp_path / "bag")
    found = messages(tmp_path / "bag")
    order = [stamp for stamp, topic in sorted(logged(tmp_path / "bag")) if "pressure" in topic]
    angles = [stamp for stamp, topic in sorted(logged(tmp_path / "bag")) if "left" in topic]
    assert len(found["/steering/pressure/main_a"]) == len(order) == 200
    assert order == angles[::5]


def test_a_bag_is_the_same_however_much_of_it_is_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two clocks, one of them in bursts that lie inside one step of the other."""
    slow, fast = np.arange(0.0, 50.0, 1.0), np.concatenate([np.arange(s, s + 0.2, 1e-3) for s in (3.5, 20.0)])
    np.savez(tmp_path / "log.npz", t=slow, a=0.01 * slow, tp=fast, p=fast)
    text = (
        HEAD + "time: {column: t}\nchannels:\n  angle/left: {column: a, unit: rad}\n"
        "  pressure/main_a: {column: p, unit: bar, time: {column: tp}}\n"
    )
    map_file, bags = write(tmp_path, "map.yaml", text), {}
    for together in (1 << 14, 7, 1):
        monkeypatch.setattr(importing_write, "TOGETHER", together)
        import_table(tmp_path / "log.npz", map_file, tmp_path / f"bag_{together}")
        with AnyReader([tmp_path / f"bag_{together}"], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            bags[together] = [(connection.topic, log, bytes(raw)) for connection, log, raw in reader.messages()]
    assert len(bags[1]) == slow.size + fast.size
    assert bags[1] == bags[7] == bags[1 << 14]


def test_messages_are_not_all_in_memory_at_once(tmp_path: Path) -> None:
    count = 400_000
    np.savez(tmp_path / "log.npz", t=0.01 * np.arange(count), a=np.sin(1e-3 * np.arange(count)))
    map_file = write(tmp_path, "map.yaml", GOOD)
    tracemalloc.start()
    try:
        import_table(tmp_path / "log.npz", map_file, tmp_path / "bag")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 16 * 8 * count  # a dozen numbers for each sample; as a message it takes forty


def test_outliers_are_not_found_in_clean_data() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 20.0, 0.01)
    for clean in (
        np.sin(time),
        np.sign(np.sin(time)),
        rng.standard_normal(2000),
        np.round(np.sin(time), 1),
        np.zeros(9),
    ):
        assert outliers(clean).size == 0
