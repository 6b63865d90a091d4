# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Channels made of several columns, units that cannot be true, and bags that are whole or not there at all."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from outside import outside
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from lugre_steering.errors import BagError, MapFileError
from lugre_steering.importing import import_table, load_map, write
from lugre_steering.importing.channels import read_channels
from lugre_steering.importing.read import read_table

ROOT = Path(__file__).resolve().parents[1]
REAL = Path(os.environ.get("LUGRE_STEERING_REAL", outside("real")))
HEAD = "schema: lugre_steering/import/1\n"
T = np.arange(0.0, 6.0, 0.01)


def save(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def csv_of(folder: Path, **columns: np.ndarray) -> Path:
    rows = zip(*columns.values(), strict=True)
    return save(folder, "log.csv", ",".join(columns) + "\n" + "".join(",".join(f"{x:.9g}" for x in row) + "\n" for row in rows))


def channels(folder: Path, table: Path, text: str) -> dict:
    mapping = load_map(save(folder, "map.yaml", HEAD + text))
    return read_channels(read_table(table, mapping.csv), mapping)


def test_sums_and_products_of_columns_short_names_and_signed_integers(tmp_path: Path) -> None:
    duty = np.round(500.0 * np.sin(T)).astype(int)
    volts = 7.0 + 0.1 * np.cos(T)
    table = tmp_path / "log.json"
    entries = [{"t": t, "load": int(d) & 0xFFFF, "supply volts": v} for t, d, v in zip(T, duty, volts, strict=True)]
    table.write_text(json.dumps({"kt": 0.3, "entries": entries}))
    found = channels(
        tmp_path,
        table,
        "time: {column: entries.t}\nnames: {volts: entries.supply volts, duty: entries.load}\nsigned: {entries.load: 16}\n"
        "channels: {measured_torque: {expression: kt / 4.8 * volts * duty / 885, unit: N m}}\n",
    )
    assert found["measured_torque"].value == pytest.approx(0.3 / 4.8 * volts * duty / 885, abs=1e-12)


@pytest.mark.parametrize(
    ("recorded", "bits", "meant"),
    [([0, 1, 127, 128, 255], 8, [0, 1, 127, -128, -1]), ([65535, 32768, 32767], 16, [-1, -32768, 32767]), ([-5, 3], 16, [-5, 3])],
)
def test_twos_complement(tmp_path: Path, recorded: list[int], bits: int, meant: list[int]) -> None:
    table = csv_of(tmp_path, t=np.arange(len(recorded)), a=np.array(recorded))
    text = f"time: {{column: t}}\nsigned: {{a: {bits}}}\nchannels: {{measured_torque: {{column: a, unit: N}}}}\n"
    assert list(channels(tmp_path, table, text)["measured_torque"].value) == meant


@pytest.mark.parametrize("recorded", [[0.5, 1], [65536, 1], [-32769, 1]])
def test_what_is_no_integer_of_so_many_bits_is_refused(tmp_path: Path, recorded: list[float]) -> None:
    table = csv_of(tmp_path, t=np.arange(2.0), a=np.array(recorded))
    with pytest.raises(MapFileError, match=r"column 'a': got .*, expected whole numbers of 16 bits"):
        channels(tmp_path, table, "time: {column: t}\nsigned: {a: 16}\nchannels: {measured_torque: {column: a, unit: N}}\n")


def test_a_moment_arm_that_changes_with_the_angle(tmp_path: Path) -> None:
    angle = 20.0 * np.sin(T)
    table = csv_of(tmp_path, t=T, angle=angle, cap=50.0 + T, rod=10.0 + 0.0 * T)
    found = channels(
        tmp_path,
        table,
        "time: {column: t}\nchannels:\n  measured_torque:\n    cylinder:\n      cap: {column: cap, unit: bar, area_m2: 0.006}\n"
        "      rod: {column: rod, unit: bar, area_m2: 0.004}\n      arm: {of: angle, polynomial_m: [0.3, 0.001, -2.0e-5]}\n",
    )["measured_torque"]
    angle = read_table(table).column("angle")
    wanted = ((50.0 + T) * 0.006 - 10.0 * 0.004) * 1e5 * (0.3 + 0.001 * angle - 2e-5 * angle**2)
    assert found.value == pytest.approx(wanted, rel=1e-6)
    assert found.unit == "N m"


@pytest.mark.parametrize("knuckle", [(0.3, 0.4), (0.3, -0.4), (-0.2, 0.5)])
@pytest.mark.parametrize("from_zero", [True, False])
def test_the_angle_from_stroke_and_pivots_is_the_one_that_turned_the_pivot(
    tmp_path: Path, knuckle: tuple[float, float], from_zero: bool
) -> None:
    chassis, theta = np.array([0.9, 0.1]), np.radians(30.0 * np.sin(T))
    turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    length = np.linalg.norm(np.einsum("ijn,j->in", turn, np.array(knuckle)) - chassis[:, None], axis=0)
    zero = float(np.linalg.norm(np.array(knuckle) - chassis)) if from_zero else 0.35
    table = csv_of(tmp_path, t=T, stroke=1e3 * (length - zero))
    given = "" if from_zero else ", zero_length_m: 0.35"
    text = f"{{pivots: {{column: stroke, unit: mm, chassis_m: [0.9, 0.1], knuckle_m: [{knuckle[0]}, {knuckle[1]}]{given}}}}}"
    found = channels(tmp_path, table, f"time: {{column: t}}\nchannels: {{angle/left: {text}}}\n")["angle/left"]
    assert found.value == pytest.approx(theta, abs=1e-7)


def test_a_stroke_beyond_the_triangle_is_refused(tmp_path: Path) -> None:
    table = csv_of(tmp_path, t=np.arange(3.0), stroke=np.array([0.0, 1.0, 900.0]))
    text = "{pivots: {column: stroke, unit: mm, chassis_m: [0.9, 0.1], knuckle_m: [0.3, 0.4]}}"
    with pytest.raises(MapFileError, match=r"1 of 3 values .*: 900 puts the pivots 1\.571 m apart, expected 0\.4055 to 1\.406 m"):
        channels(tmp_path, table, f"time: {{column: t}}\nchannels: {{angle/left: {text}}}\n")
    table = csv_of(tmp_path, t=T, stroke=np.where(T == 1.0, -9999.0, 0.0))
    found = channels(tmp_path, table, f"time: {{column: t}}\nchannels: {{angle/left: {text}}}\n")["angle/left"]
    assert (found.value.size, found.missing) == (T.size - 1, 1)


def test_time_from_seconds_and_nanoseconds_or_from_a_rate(tmp_path: Path) -> None:
    table = csv_of(tmp_path, sec=np.array([100, 100, 101]), nsec=np.array([0, 5e8, 0]), a=np.array([1, 2, 3]))
    text = "channels: {angle/left: {column: a, unit: deg}}\n"
    found = channels(tmp_path, table, "time: {expression: sec + 1e-9 * nsec}\n" + text)
    assert list(found["angle/left"].time_s) == [100.0, 100.5, 101.0]
    found = channels(tmp_path, table, "time: {rate_Hz: 50}\n" + text)
    assert found["angle/left"].time_s == pytest.approx([0.0, 0.02, 0.04])


GOOD = HEAD + "time: {column: t}\nchannels: {measured_torque: {expression: a * b, unit: N}}\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("a * b", "a * c"), r"channel measured_torque: expression 'a \* c': at character 5: no 'c'; names here: a, b, t"),
        (GOOD.replace("a * b", "2 * 3"), "holds no column"),
        (GOOD.replace("{column: t}", "{column: t, rate_Hz: 5}"), r"key 'time': got \['column', 'rate_Hz'\], expected exactly one of"),
        (GOOD.replace("{column: t}", "{unit: s}"), "key 'time': got nothing, expected exactly one of"),
        (GOOD + "signed: {a: 2.5}\n", "key 'signed.a': got 2.5, expected a whole number"),
        (GOOD + "signed: {z: 16}\n", r"no column 'z'.* \(key 'signed' of the map\)"),
        (GOOD + "names: {'a b': a}\n", "key 'names': got 'a b'"),
        (GOOD + "names: {sin: a}\n", "key 'names': got 'sin'"),
        (GOOD + "names: {z: gone}\n", None),
        (GOOD.replace("a * b", "a * z") + "names: {z: gone}\n", "no column 'gone'"),
        (GOOD + "csv: {allow: [anything]}\n", "key 'csv.allow': got 'anything', expected one of short_rows"),
        (GOOD + "csv: {name_row: 2}\n", "key 'csv.name_row': got 2.0, expected one of the 1 header rows"),
        (GOOD + "csv: {encoding: ebcdic}\n", "key 'csv.encoding'"),
        (GOOD + "csv: {columns: [a, a]}\n", "key 'csv.columns'.*distinct"),
        (GOOD.replace("expression: a * b, unit: N", "pivots: {column: a, unit: mm, chassis_m: [1, 0], knuckle_m: [0, 1]}"),
         "pivots for an angle only"),
        (HEAD + "time: {column: t}\nchannels: {angle/left: {pivots: {column: a, unit: mm, chassis_m: [1, 0], knuckle_m: [2, 0]}}}\n",
         "in one line a stroke tells no direction"),
    ],
)  # fmt: skip
def test_mistakes_are_named(tmp_path: Path, text: str, message: str | None) -> None:
    table, map_file = csv_of(tmp_path, t=T, a=T, b=T), save(tmp_path, "map.yaml", text)
    if message is None:  # a short name that nobody uses
        import_table(table, map_file, tmp_path / "bag")
        return
    with pytest.raises(MapFileError, match=message):
        import_table(table, map_file, tmp_path / "bag")
    assert {path.name for path in tmp_path.iterdir()} == {"log.csv", "map.yaml"}


# ---------------------------------------------------------------- units


def refused(tmp_path: Path, table: Path, text: str) -> str:
    with pytest.raises(MapFileError) as error:
        import_table(table, save(tmp_path, "map.yaml", HEAD + "time: {column: t}\nchannels:\n" + text), tmp_path / "bag")
    return str(error.value)


def test_degrees_labelled_as_radians_are_caught(tmp_path: Path) -> None:
    table = csv_of(tmp_path, t=T, a=30.0 * np.sin(T))
    said = refused(tmp_path, table, "  angle/left: {column: a, unit: rad}\n")
    assert "channel angle/left: the unit 'rad' makes it -30 ... 29.99 rad, expected less than a turn" in said
    assert "is the column in deg?" in said
    assert "'farthest: 40'" in said


def test_a_joint_may_turn_as_far_as_its_map_says(tmp_path: Path) -> None:
    table = csv_of(tmp_path, t=T, a=30.0 * np.sin(T))
    text = HEAD + "time: {column: t}\nchannels:\n  angle/left: {column: a, unit: rad, farthest: %s}\n"
    import_table(table, save(tmp_path, "map.yaml", text % 40), tmp_path / "bag")
    assert "expected up to 20 rad" in refused(tmp_path, table, "  angle/left: {column: a, unit: rad, farthest: 20}\n")
    said = refused(tmp_path, table, "  angle/left: {column: a, unit: deg, farthest: 7}\n")
    assert "farthest': got 7.0, expected an angle in rad or mrad" in said


@pytest.mark.parametrize(("angle", "rate"), [("rad", "rad/s"), ("deg", "deg/s")])
def test_small_degrees_labelled_as_radians_are_caught_by_the_rate(tmp_path: Path, angle: str, rate: str) -> None:
    """Two degrees could be two radians; only the rate tells."""
    degrees, per_second = 2.0 * np.sin(T), 2.0 * np.cos(T)
    noise = np.random.default_rng(1).normal(0.0, 0.02, (2, T.size))
    table = csv_of(tmp_path, t=T, a=degrees + noise[0], w=np.radians(per_second + noise[1]))  # deg, rad/s
    said = refused(tmp_path, table, f"  angle/left: {{column: a, unit: {angle}}}\n  rate/left: {{column: w, unit: {rate}}}\n")
    assert "moves 57 times as far as" in said
    right = "  angle/left: {column: a, unit: deg}\n  rate/left: {column: w, unit: rad/s}\n"
    map_file = save(tmp_path, "right.yaml", HEAD + "time: {column: t}\nchannels:\n" + right)
    assert import_table(table, map_file, tmp_path / "bag")["channels"][0]["doubts"] == []


@pytest.mark.parametrize(
    ("rate", "of_angle", "of_rate"),
    [
        (np.full_like(T, 9000.0), "moves otherwise than its rate says", []),
        (np.zeros_like(T), "moves otherwise than its rate says", []),
        (np.where(T == 1.0, 1e30, 30.0 * np.cos(T)), None, ["1 sample beyond 1000 rad/s, which count as missing: is the unit deg/s?"]),
        (np.where(T < 4.0, 30.0 * np.cos(T), np.inf), None, []),
    ],
)
def test_a_rate_is_told_of_too(tmp_path: Path, rate: np.ndarray, of_angle: str | None, of_rate: list[str]) -> None:
    table = csv_of(tmp_path, t=T, a=30.0 * np.sin(T), w=rate)
    text = HEAD + "time: {column: t}\nchannels:\n  angle/left: {column: a, unit: deg}\n  rate/left: {column: w, unit: deg/s}\n"
    angle, row = import_table(table, save(tmp_path, "map.yaml", text), tmp_path / "bag")["channels"]
    assert row["channel"] == "rate/left"
    assert row["missing"] == np.sum(~np.isfinite(rate))
    assert row["doubts"] == of_rate
    assert (of_angle is None and angle["doubts"] == []) or (of_angle is not None and of_angle in angle["doubts"][0])


def test_a_rate_without_numbers_is_refused(tmp_path: Path) -> None:
    text = "  angle/left: {column: a, unit: deg}\n  rate/left: {column: w, unit: deg/s}\n"
    said = refused(tmp_path, csv_of(tmp_path, t=T, a=T, w=np.nan * T), text)
    assert "channel rate/left: no number in any of the 600 rows of angle/left" in said


def test_one_side_in_degrees_and_one_in_radians_is_caught(tmp_path: Path) -> None:
    table = csv_of(tmp_path, t=T, l=2.0 * np.sin(T), r=np.radians(1.9 * np.sin(T)))
    said = refused(tmp_path, table, "  angle/left: {column: l, unit: rad}\n  angle/right: {column: r, unit: rad}\n")
    assert "channel angle/left: moves 57 times as far as angle/right" in said


@pytest.mark.parametrize(
    ("channel", "value", "unit", "doubt"),
    [
        ("angle/left", 2.0 * np.sin(T), "rad", "-115 ... 115 deg: is the unit rad"),
        ("angle/left", 0.6 * np.sin(T), "deg", "travels 1.2 deg only"),
        ("angle/left", 30.0 * np.sin(T), "deg", None),
        ("angle/left", 0.6 * np.sin(T), "rad", None),
        ("pressure/a", 200.0 + T, "Pa", "is the unit Pa?"),
        ("pressure/a", 2e7 + T, "bar", "is the unit bar?"),
        ("pressure/a", 200.0 + T, "bar", None),
        ("pressure/a", np.where(T < 2.0, -62.5, 100.0), "bar", "200 samples below a vacuum, down to -62.5 bar: a broken wire"),
        ("pressure/a", 100.0 * T - 1.0, "bar", None),
        ("air_temperature", 293.0 + 0.0 * T, "degC", "is the unit degC?"),
        ("air_temperature", 293.0 + 0.0 * T, "K", None),
    ],
)
def test_an_odd_range_is_told_and_a_usual_one_not(
    tmp_path: Path, channel: str, value: np.ndarray, unit: str, doubt: str | None
) -> None:
    text = f"time: {{column: t}}\nchannels: {{{channel}: {{column: a, unit: {unit}}}}}\n"
    (row,) = import_table(csv_of(tmp_path, t=T, a=value), save(tmp_path, "map.yaml", HEAD + text), tmp_path / "bag")["channels"]
    assert (doubt is None and row["doubts"] == []) or (doubt is not None and doubt in row["doubts"][0])


def test_clocks_of_different_zero_are_told(tmp_path: Path) -> None:
    text = "channels:\n  angle/left: {column: a, unit: deg, time: {column: t}}\n  pressure/a: {column: p, unit: bar, time: {column: u}}\n"
    table = csv_of(tmp_path, t=T, a=20.0 * np.sin(T), u=T + 1000.0, p=100.0 + T)
    rows = import_table(table, save(tmp_path, "map.yaml", HEAD + text), tmp_path / "bag")["channels"]
    assert rows[0]["doubts"] == ["no time in common with pressure/a: clocks of different zero?"]


# ------------------------------------------------------- whole or not at all

SIMPLE = HEAD + "time: {column: t}\nchannels: {angle/left: {column: a, unit: deg}}\n"


def count(bag: Path) -> int:
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        return sum(1 for _ in reader.messages())


def test_a_killed_import_leaves_nothing_under_the_final_name_and_does_not_block_the_next(tmp_path: Path) -> None:
    table, map_file = csv_of(tmp_path, t=T, a=T), save(tmp_path, "map.yaml", SIMPLE)
    script = (
        "import sys, time\nfrom pathlib import Path\nfrom lugre_steering.importing import write\n"
        "write.BagWriter.close = lambda self: (print('written', flush=True), time.sleep(60))\n"
        "write.import_table(*map(Path, sys.argv[1:]))\n"
    )
    out = tmp_path / "bag"
    with subprocess.Popen([sys.executable, "-c", script, table, map_file, out], stdout=subprocess.PIPE, cwd=ROOT) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"written\n"
        with pytest.raises(BagError, match="another import writes it just now"):
            import_table(table, map_file, out)
        process.kill()
    assert not out.exists()
    assert (tmp_path / ".bag.importing" / "bag").is_dir()
    import_table(table, map_file, out)
    assert count(out) == T.size
    assert not (tmp_path / ".bag.importing").exists()


def test_a_failed_import_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table, map_file = csv_of(tmp_path, t=T, a=T), save(tmp_path, "map.yaml", SIMPLE)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(write.BagWriter, "_metadata", full)
    with pytest.raises(BagError, match="No space left"):
        import_table(table, map_file, tmp_path / "new" / "bag")
    assert list((tmp_path / "new").iterdir()) == []


def test_what_others_put_in_the_way_is_left_alone(tmp_path: Path) -> None:
    table, map_file, elsewhere = csv_of(tmp_path, t=T, a=T), save(tmp_path, "map.yaml", SIMPLE), tmp_path / "elsewhere"
    elsewhere.mkdir()
    save(elsewhere, "precious", "x")
    (tmp_path / ".bag.importing").symlink_to(elsewhere)
    with pytest.raises(BagError, match="cannot be written"):
        import_table(table, map_file, tmp_path / "bag")
    (tmp_path / ".bag.importing").unlink()
    (tmp_path / ".bag.importing").mkdir()
    (tmp_path / ".bag.importing" / "bag").symlink_to(elsewhere)
    with pytest.raises(BagError, match="which no import left there"):
        import_table(table, map_file, tmp_path / "bag")
    (tmp_path / "bag").symlink_to(tmp_path / "nowhere")
    with pytest.raises(BagError, match="exists already"):
        import_table(table, map_file, tmp_path / "bag")
    assert (elsewhere / "precious").read_text() == "x"


# ------------------------------------------------------ recordings of others


@pytest.mark.skipif(not (REAL / "pneumatic_cylinder").is_dir(), reason="no raw files (LUGRE_STEERING_REAL)")
def test_a_table_without_header_as_a_stage_wrote_it() -> None:
    file = REAL / "pneumatic_cylinder" / "circle_1bar.csv"
    found = shipped(file, "pneumatic_cylinder_map.yaml")
    raw = np.loadtxt(file)
    assert found["angle/left"].value == pytest.approx(1e-3 * raw[:, 4])
    assert found["measured_torque"].value == pytest.approx(raw[:, 6])
    assert found["measured_torque"].time_s == pytest.approx(1e-3 * raw[:, 0])


@pytest.mark.skipif(not (REAL / "servo_pendulum").is_dir(), reason="no raw files (LUGRE_STEERING_REAL)")
def test_a_servo_with_signed_duty_in_json() -> None:
    """The torque that the map makes of duty and voltage pulls towards where the weight hangs, and against the motion."""
    rows, torques = [], []
    for file in sorted((REAL / "servo_pendulum").glob("*.json")):
        found = shipped(file, "servo_pendulum_map.yaml")
        angle, torque = found["angle/left"], found["measured_torque"].value
        assert angle.rate is not None
        assert np.abs(torque).max() < 0.3232 / 4.764 * 9.0  # stall torque at more than the supply
        on = torque != 0.0
        rows.append(np.column_stack([np.sin(angle.value), angle.rate, np.sign(angle.rate)])[on])
        torques.append(torque[on])
    gravity, viscous, coulomb = np.linalg.lstsq(np.vstack(rows), np.concatenate(torques), rcond=None)[0]
    assert gravity == pytest.approx(0.49 * 9.81 * 0.1, rel=0.5)  # mass and length in the files; friction and losses beside it
    assert 0.0 < viscous < 0.1
    assert 0.0 < coulomb < 0.1


def shipped(file: Path, map_file: str) -> dict:
    mapping = load_map(ROOT / "config" / map_file)
    return read_channels(read_table(file, mapping.csv), mapping)


@pytest.mark.parametrize("name", sorted(path.name for path in (ROOT / "config").glob("*_map.yaml")))
def test_the_shipped_maps_are_read(name: str) -> None:
    assert {"angle/left", "measured_torque"} <= set(load_map(ROOT / "config" / name).channels)
