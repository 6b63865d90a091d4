# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Vehicle files: round trip, and every mistake refused with file, key, value and expectation."""

from __future__ import annotations

import copy
import json
import math
import shutil
import tempfile
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
import yaml
from catalogue import put_back
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from lugre_steering.cli import app
from lugre_steering.effects.law_entry import LawEntry, named
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import ImplausibleWarning, LugreSteeringError, VehicleFileError
from lugre_steering.estimator.node_parameters import read_options
from lugre_steering.schema import Reader
from lugre_steering.sheet.derived import derive
from lugre_steering.simulate.manoeuvres import from_yaml
from lugre_steering.vehicle import EffectEntry, Vehicle, from_mapping, load, pavements, save
from lugre_steering.vehicle.plausible import plausibility
from lugre_steering.vehicle.sections import Initial, Topics

CONFIG = Path(__file__).resolve().parents[1] / "config"
FILE = CONFIG / "test_vehicle.yaml"
SHEET: dict[str, Any] = yaml.safe_load(FILE.read_text())
SHEET["sensors"] |= {"pressure_range_Pa": 25e6, "pressure_noise_Pa": 1.5e4}  # YAML 1.1 takes both for texts
JOINT: dict[str, Any] = {
    "schema": "lugre_steering/vehicle/1",
    "name": "one joint",
    "sides": ["left"],
    "contact": {
        "static_torque_Nm": 12.0,
        "coulomb_torque_Nm": 10.0,
        "stiffness_Nm_per_deg": 50.0,
        "stribeck_speed_deg_s": 2.0,
    },
    "torque_sensor": {"topic": "joint/torque"},
}
REMOVE = object()


def changed(sheet: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A copy with one dotted key set or removed."""
    result = copy.deepcopy(sheet)
    *parents, last = path.split(".")
    node = result
    for name in parents:
        node = node.setdefault(name, {})
    if value is REMOVE:
        del node[last]
    else:
        node[last] = value
    return result


def test_reference_vehicle_loads_with_its_table() -> None:
    vehicle = load(FILE)
    assert vehicle.rubber is not None
    assert vehicle.rubber.dma is not None
    assert len(vehicle.rubber.dma.temperature_degC) > 50
    assert [c.name for c in vehicle.channels] == ["left", "right", "main_a", "main_b", "aux_a", "aux_b", "air"]


def test_the_defaults_told_in_the_reference_vehicle_are_those(tmp_path: Path) -> None:
    text = FILE.read_text().replace("#: ", "").replace("  # temperature_law", "  temperature_law")
    text = text.replace("  # pressure_gain", "  pressure_gain").replace("rubber_dma", f"{FILE.parent}/rubber_dma")
    (tmp_path / "told.yaml").write_text(text)
    assert {"topics", "sensors", "friction"} <= yaml.safe_load(text).keys()
    assert "temperature_law" in yaml.safe_load(text)["friction"]
    assert "pressure_gain" in yaml.safe_load(text)["sensors"]
    assert len(yaml.safe_load(text)["topics"]) == len(fields(Topics))
    assert load(tmp_path / "told.yaml") == load(FILE)


@pytest.mark.parametrize("sheet", [SHEET, JOINT], ids=["vehicle", "joint"])
def test_round_trip_stands_alone(sheet: dict[str, Any], tmp_path: Path) -> None:
    vehicle = from_mapping(sheet, FILE)
    save(vehicle, tmp_path / "copy.yaml")
    assert load(tmp_path / "copy.yaml") == vehicle
    assert "dma_csv" not in (tmp_path / "copy.yaml").read_text()


def test_effects_and_provenance_survive(tmp_path: Path) -> None:
    sheet = changed(SHEET, "effects", [{"id": "end_stop", "parameters": {"stiffness": 5e4, "engage_angle": 0.3}}])
    sheet["provenance"] = {"bag": "a", "when": 3}
    vehicle = from_mapping(sheet, FILE)
    save(vehicle, tmp_path / "copy.yaml")
    assert load(tmp_path / "copy.yaml") == vehicle
    assert vehicle.effects[0].parameters == {"stiffness": 5e4, "engage_angle": 0.3}


def with_effects(*entries: tuple[str, dict[str, float]]) -> dict[str, Any]:
    return changed(SHEET, "effects", [{"id": name, "parameters": values} for name, values in entries])


@pytest.mark.parametrize(
    ("name", "values", "key", "expectation"),
    [
        ("end_stp", {"stiffness": 1e5}, "id", "did you mean 'end_stop'"),
        ("end_stop", {}, "parameters", "values of engage_angle"),
        ("end_stop", {"stifness": 1e5}, "parameters.stifness", "did you mean 'stiffness'"),
        ("end_stop", {"stiffness": -1e5, "engage_angle": 0.3}, "parameters.stiffness", "from 0 to"),
        ("end_stop", {"stiffness": 1e5}, "parameters", "values of engage_angle"),
        ("slope_bias", {}, "parameters", "values of torque"),
        ("pressure_offset", {"main_x": 1e5}, "parameters.main_x", "no such line; did you mean 'main_"),
        ("pressure_offset", {}, "parameters", "values of main_a"),
        ("pressure_lag", {"tau": -1.0}, "parameters.tau", "from 0 to 2"),
        ("heat_partition", {"ground_share": 5.0}, "parameters.ground_share", "from 0 to 0.95"),
        ("angle_scale", {"scale": -1.0}, "parameters.scale", "from -0.2 to 0.2"),
        ("carcass_heat_sink", {"conductance": 10.0}, "parameters", "values of capacity"),
        ("static_ageing", {"rate": 0.1}, "parameters", "values of dwell, slip_scale"),
        ("load_transfer", {}, "id", "needs an attitude sensor"),
        ("surface_patch", {"change": 0.2, "angle_low": 0.2}, "parameters.angle_high", "more than angle_low (0.2), both"),
        ("surface_patch", {"change": 0.2, "time_start": 9.0, "time_end": 8.0}, "parameters.time_end", "more than time_start (9)"),
    ],
)
def test_wrong_effects_are_refused(name: str, values: dict[str, float], key: str, expectation: str) -> None:
    with pytest.raises(VehicleFileError) as caught:
        from_mapping(with_effects(("yaw_inertia", {"inertia": 1.0}), (name, values)), FILE)
    assert f"{FILE}: key 'effects[1].{key}': got " in str(caught.value)
    assert expectation in str(caught.value)


def test_an_effect_stands_once() -> None:
    bias = ("slope_bias", {"torque": 1.0})
    with pytest.raises(VehicleFileError, match=r"effects\[1\].id': got 'slope_bias', expected each effect once"):
        from_mapping(with_effects(bias, bias), FILE)
    offsets = [("pressure_offset", {line: 1e5}) for line in ("main_a", "main_b", "main_b")]
    vehicle = from_mapping(with_effects(offsets[0], bias, offsets[1]), FILE)
    assert [entry.id for entry in vehicle.effects] == ["pressure_offset", "slope_bias"]
    assert vehicle.effects[0].parameters == {"main_a": 1e5, "main_b": 1e5}
    with pytest.raises(VehicleFileError, match="each effect and line once"):
        from_mapping(with_effects(*offsets), FILE)


def test_effects_found_again_are_saved_once(tmp_path: Path) -> None:
    entries = [
        EffectEntry("end_stop", {"stiffness": 1e5, "engage_angle": 0.3}),
        EffectEntry("pressure_offset", {"main_a": 1e5}),
        EffectEntry("pressure_offset", {"main_b": 2e5}),
        EffectEntry("end_stop", {"stiffness": 2e5, "engage_angle": 0.4}),
    ]
    save(from_mapping(SHEET, FILE).replace(effects=tuple(entries)), tmp_path / "copy.yaml")
    saved = {entry.id: entry.parameters for entry in load(tmp_path / "copy.yaml").effects}
    assert saved == {
        "end_stop": {"stiffness": 2e5, "engage_angle": 0.4},
        "pressure_offset": {"main_a": 1e5, "main_b": 2e5},
    }


def test_thermal_effects_need_rubber() -> None:
    sheet = changed(JOINT, "effects", [{"id": "ambient_drift", "parameters": {"rate": 0.1}}])
    with pytest.raises(VehicleFileError, match="section 'rubber'"):
        from_mapping(sheet, FILE)


def test_an_arm_needs_a_cylinder() -> None:
    sheet = changed(JOINT, "effects", [{"id": "moment_arm_error", "parameters": {"linear": 0.1}}])
    with pytest.raises(VehicleFileError, match="section 'hydraulics', whose cylinders have arms"):
        from_mapping(sheet, FILE)


def test_gravity_along_an_axis_is_refused() -> None:
    sheet = {**JOINT, "gravity": {"cos_Nm": 5.0, "sin_Nm": 0.0}}
    assert from_mapping(sheet, FILE).gravity is not None
    linear = {"name": "position", "unit": "m", "force_unit": "N"}
    with pytest.raises(VehicleFileError, match=r"key 'gravity'.*effect slope_bias"):
        from_mapping({**sheet, "coordinate": linear}, FILE)


def test_a_master_curve_must_reach_the_temperatures_of_the_file() -> None:
    curve = {"frequency_Hz": [1.0, 1e3, 1e6], "storage_modulus_Pa": [1e7, 1e8, 1e9], "loss_modulus_Pa": [1e6, 1e7, 1e8]}
    wlf = {"c1": 10.0, "c2_K": 50.0, "reference_degC": 20.0}
    sheet = changed(changed(changed(SHEET, "rubber.dma_csv", REMOVE), "rubber.wlf", wlf), "rubber.master_curve", curve)
    # 1 Hz at 20 degC is what 10 Hz sees where the shift is 0.1: 20 + 50 / 9 degC.
    assert from_mapping(changed(sheet, "initial.rubber_temperature_degC", 25.5), FILE).rubber is not None
    with pytest.raises(VehicleFileError, match=r"initial.rubber_temperature_degC': got 25\.6, expected .*inside .* to 25\.56 degC"):
        from_mapping(changed(sheet, "initial.rubber_temperature_degC", 25.6), FILE)


def test_rubber_starts_at_the_reference_temperature_if_nothing_is_said() -> None:
    vehicle = from_mapping(changed(changed(SHEET, "initial", REMOVE), "friction.reference_temperature_degC", 17.0), FILE)
    assert vehicle.initial == Initial(17.0, 17.0)


@pytest.mark.parametrize(
    ("sheet", "effect", "section"),
    [(JOINT, "line_loss_linear", "hydraulics"), (SHEET, "gear_friction", "contact"), (JOINT, "warm_loss", "rubber")],
)
def test_an_effect_stands_only_where_what_it_needs_does(sheet: dict[str, Any], effect: str, section: str) -> None:
    with put_back():
        law = LawEntry("gain", "rubber_temperature", "linear", (0.0, 50.0), {"value": 0.0, "slope": 0.01})
        CATALOGUE["warm_loss"] = named("warm_loss", "a loss when warm", "a test", law)
        values = {p.name: p.typical for p in CATALOGUE[effect].parameters}
        with pytest.raises(VehicleFileError, match=f"'{effect}', expected a vehicle with the section '{section}'"):
            from_mapping(changed(sheet, "effects", [{"id": effect, "parameters": values}]), FILE)


def test_every_effect_loads_at_the_bounds_of_a_fit() -> None:
    for effect in CATALOGUE.values():
        for bound in ("low", "high"):
            values = {p.name: p.unscaled(p.scaled(getattr(p, bound))) for p in effect.parameters}
            if effect.per_line:
                values = {"main_a": next(iter(values.values()))}
            for low, high in effect.places:  # the ends of a range are not equal
                values |= {high: values[low] + 0.1} if bound == "low" else {low: values[high] - 0.1}
            if effect.observable:
                sheet = JOINT if "contact" in effect.needs else SHEET
                from_mapping(changed(sheet, "effects", [{"id": effect.id, "parameters": values}]), FILE)


def test_exponent_without_point_is_a_number(tmp_path: Path) -> None:
    text = FILE.read_text().replace("load_N: 90000.0", "load_N: 9e4").replace("rubber_dma", str(CONFIG / "rubber_dma"))
    (tmp_path / "v.yaml").write_text(text)
    axle = load(tmp_path / "v.yaml").axle
    assert axle is not None
    assert axle.load_N == 90_000.0


def test_pavement_by_name_fills_friction() -> None:
    sheet = changed(changed(SHEET, "friction.static", REMOVE), "friction.coulomb", REMOVE)
    for name, row in pavements().items():
        friction = from_mapping(changed(sheet, "friction.pavement", name), FILE).friction
        assert friction is not None
        assert (friction.static, friction.coulomb) == (row["static"], row["coulomb"])


def test_shipped_pavements_keep_the_published_ranking() -> None:
    level = {name: row["coulomb"] for name, row in pavements().items()}
    ranking = ["dry_asphalt", "wet_asphalt", "wet_concrete", "dry_earth", "gravel"]
    assert level["dry_concrete"] == level["dry_asphalt"]
    assert [level[name] for name in ranking] == sorted((level[name] for name in ranking), reverse=True)
    assert all(row["source"] == "assumed" for name, row in pavements().items() if name.startswith("wet"))


MISTAKES = [
    ("schema", "lugre_steering/vehicle/2", "'lugre_steering/vehicle/1'"),
    ("schema", REMOVE, "'lugre_steering/vehicle/1'"),
    ("name", REMOVE, "a text"),
    ("name", 7, "a text"),
    ("axel", {}, "did you mean 'axle'"),
    ("axle", REMOVE, "this section"),
    ("axle", 3.0, "a mapping"),
    ("axle.load_N", -1.0, "from 1 to"),
    ("axle.load_N", "90 kN", "a plain number"),
    ("axle.load_N", True, "a plain number"),
    ("axle.load_N", math.nan, "finite"),
    ("axle.load_N", math.inf, "finite"),
    ("axle.load_N", 10**400, "finite"),
    ("axle.load_N", None, "this key"),
    ("axle.wheel_base_m", 3.0, "did you mean 'wheelbase_m'"),
    ("axle.kingpin_inclination_deg", 60.0, "from 0 to 45"),
    ("track.rollers.x_m", [], "at least one roller"),
    ("track.rollers.x_m", 0.3, "a list"),
    ("track.rollers.load_share", [0.5, 0.5], "4 shares"),
    ("track.rollers.load_share", [0.3, 0.3, 0.3, 0.3], "sum to 1"),
    ("track.rollers.load_share", REMOVE, "exactly one of load_share and levers"),
    ("track.ground_pressure_exponent", 5.0, "from 2 to 4"),
    ("friction.static", 0.5, "at least friction.coulomb"),
    ("friction.temperature_law", "magic", "loss_tangent"),
    ("friction.reference_temperature_degC", 140.0, "inside the rubber table"),
    ("rubber.dma_csv", "missing.csv", "a readable CSV file"),
    ("rubber.dma_csv", "a\0b", "a readable CSV file"),
    ("rubber.dma_csv", REMOVE, "exactly one of dma_csv"),
    ("rubber.dma", {"temperature_degC": [1.0]}, "not both"),
    ("rubber.density_kg_m3", 0.0, "from 100 to"),
    ("hydraulics", REMOVE, "exactly one of 'hydraulics' and 'torque_sensor'"),
    ("torque_sensor", {}, "exactly one of 'hydraulics' and 'torque_sensor'"),
    ("hydraulics.lines", ["main_a", "main_a"], "distinct"),
    ("hydraulics.cylinders", {}, "at least one cylinder"),
    ("hydraulics.cylinders.left_main.side", "middle", "left, right"),
    ("hydraulics.cylinders.left_main.cap", "main_c", "main_a"),
    ("hydraulics.cylinders.left_main.rod_m", 0.2, "less than bore_m"),
    ("hydraulics.cylinders.left_main.knuckle_m", [0.0, 0.0], "away from the hinge"),
    ("hydraulics.cylinders.left_main.chassis_m", [1.0], "two coordinates"),
    ("sensors.pressure_reference", "vacuum", "gauge or absolute"),
    ("coordinate", {"unit": "deg", "force_unit": "N m"}, "rad or m"),
    ("coordinate", {"unit": "m"}, "'N', as the coordinate is in m"),
    ("hydraulics.lines", ["main_a", "main_b", "aux_a", "aux_b", "tank"], "no line called tank"),
    ("hydraulics.lines", ["main_a", "main_b", "aux_a", "aux_b", "main-a"], "the name of a ROS topic"),
    ("topics", {"left": "steering left"}, "the name of a ROS topic"),
    ("topics", {"pressure_prefix": "steering//"}, "the name of a ROS topic"),
    ("topics", {"ambient_temperature": "/air/"}, "the name of a ROS topic"),
    ("topics", {"left": "/joint_states", "right": "/joint_states", "left_joint": "a", "right_joint": "a"}, "another joint"),
    ("track", {**SHEET["track"], "rollers": {"x_m": [0.0], "load_share": [1.0]}, "hinge_offset_m": 0.0}, "no arm"),
    ("sides", ["left", "left"], "left, right"),
    ("sides", "left", "a list"),
    ("contact", JOINT["contact"], "beside 'contact'"),
]


@pytest.mark.parametrize(("key", "value", "expectation"), MISTAKES)
def test_mistakes_are_refused_with_file_key_value_and_expectation(key: str, value: Any, expectation: str) -> None:
    with pytest.raises(VehicleFileError) as caught:
        from_mapping(changed(SHEET, key, value), FILE)
    message = str(caught.value)
    assert message.startswith(f"{FILE}: key '")
    assert "got " in message
    assert expectation in message.split("expected", 1)[1]
    named = message.split("key '", 1)[1].split("'", 1)[0]
    # The key named is the wrong one, an inner part of it, the section it belongs to, or its counterpart.
    assert named.split(".")[0].split("[")[0] in {key.split(".")[0], "axle", "hydraulics", "(top level)"}
    shown = "nothing" if value in (REMOVE, None) else repr(value)[:30]
    if named == key and not isinstance(value, (list, dict)):
        assert shown in message


def test_a_joint_is_told_of_its_own_section() -> None:
    sheet = {**JOINT, "rubber": SHEET["rubber"], "initial": SHEET["initial"]}
    with pytest.raises(VehicleFileError, match=r"'contact\.reference_temperature_degC': got 140"):
        from_mapping(changed(sheet, "contact.reference_temperature_degC", 140.0), FILE)


def test_names_that_ros_accepts_load() -> None:
    topics = {"left": "/joint_states", "right": "/joint_states", "pressure_prefix": "~/p_", "ambient_temperature": "Air2"}
    vehicle = from_mapping(changed(SHEET, "topics", topics), FILE)
    assert [channel.topic for channel in vehicle.channels][1:3] == ["/joint_states", "~/p_main_a"]


def test_a_key_that_stands_twice_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "v.yaml"
    file.write_text(FILE.read_text().replace("  load_N:", "  load_N: 1.0\n  load_N:", 1))
    with pytest.raises(VehicleFileError, match=r"v\.yaml: .*'load_N' stands twice.*line \d+"):
        load(file)
    file.write_text("a: &a {x: 1}\nb: {<<: *a, x: 2}\n")
    assert Reader(file, VehicleFileError).load() == {"a": {"x": 1}, "b": {"x": 2}}


def test_a_table_saved_by_a_spreadsheet_loads(tmp_path: Path) -> None:
    rows = (CONFIG / "rubber_dma_10hz.csv").read_text().splitlines()
    text = "\n".join(row for row in rows if not row.startswith("#"))
    (tmp_path / "table.csv").write_text(text, encoding="utf-8-sig")
    vehicle = from_mapping(changed(SHEET, "rubber.dma_csv", "table.csv"), tmp_path / "v.yaml")
    assert vehicle.rubber == load(FILE).rubber


def test_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(VehicleFileError, match="cannot be read"):
        load(tmp_path / "none.yaml")
    bad = tmp_path / "bad.yaml"
    bad.write_text("a: [1, 2")
    with pytest.raises(VehicleFileError, match="not valid YAML"):
        load(bad)
    bad.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(VehicleFileError, match="not valid YAML"):
        load(bad)
    for text in ("a: 2020-13-45", "a: " + "1" * 5000, "[" * 5000):
        bad.write_text(text)
        with pytest.raises(VehicleFileError, match="not valid YAML"):
            load(bad)
    bad.write_text("")
    with pytest.raises(VehicleFileError, match="a mapping"):
        load(bad)


def test_broken_tables(tmp_path: Path) -> None:
    sheet = changed(SHEET, "rubber.dma_csv", "table.csv")
    file, table = tmp_path / "v.yaml", tmp_path / "table.csv"
    head = "temperature_degC,storage_modulus_Pa,loss_modulus_Pa\n"
    for text, expectation in (
        ("", "columns"),
        ("a,b\n1,2\n", "columns"),
        (head + "-90,1e6,1e5\n0,x,1e5\n90,1e6,1e5\n", "line 3"),
        (head + "-90,1e6\n", "line 2"),
        (head + "-90,1e6,1e5\n90,1e6,1e5\n", "at least 3 rows"),
        (head + "-90,1e6,1e5\n95,1e6,1e5\n90,1e6,1e5\n", "strictly increasing"),
        (head + "-90,1e6,1e5\n0,-1,1e5\n90,1e6,1e5\n", "from 100 to"),
    ):
        table.write_text(text)
        with pytest.raises(VehicleFileError, match=expectation):
            from_mapping(sheet, file)


scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.just([]) | st.just({})
values = st.recursive(
    scalars,
    lambda x: st.lists(x, max_size=3) | st.dictionaries(st.text(max_size=4) | st.integers(), x, max_size=3),
    max_leaves=5,
)


def paths(node: Any, prefix: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    found = [prefix] if prefix else []
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, inner in items:
        found += paths(inner, (*prefix, key))
    return found


@settings(max_examples=300)
@given(st.data(), st.sampled_from([SHEET, JOINT]))
def test_any_mutation_gives_a_vehicle_or_a_clear_error(data: st.DataObject, original: dict[str, Any]) -> None:
    sheet = copy.deepcopy(original)
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from(paths(sheet)))
        node = sheet
        for key in path[:-1]:
            node = node[key]
        action = data.draw(st.sampled_from(["set", "delete", "add"]))
        if action == "set":
            node[path[-1]] = data.draw(values)
        elif action == "delete":
            del node[path[-1]]
        elif isinstance(node, dict):
            node[data.draw(st.text(max_size=6) | st.integers())] = data.draw(values)
        if not paths(sheet):
            break
    try:
        vehicle = from_mapping(sheet, FILE)
    except VehicleFileError as error:
        message = str(error)
    else:
        assert isinstance(vehicle, Vehicle)
        return
    assert str(FILE) in message


@settings(max_examples=200)
@given(st.binary(max_size=80), st.integers(0, 3000))
def test_any_bytes_give_a_vehicle_or_a_clear_error(noise: bytes, position: int) -> None:
    text = FILE.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "v.yaml"
        file.write_bytes(text[:position] + noise + text[position + len(noise) :])
        message = str(file)
        try:
            load(file)
        except VehicleFileError as error:
            message = str(error)
        assert str(file) in message


# ------------------------------------------------------------- plausibility


@pytest.mark.parametrize("file", sorted(CONFIG.glob("*vehicle.yaml")) + sorted(CONFIG.glob("*example.yaml")), ids=lambda f: f.stem)
def test_the_shipped_vehicles_raise_no_doubt(file: Path) -> None:
    assert plausibility(load(file)) == ()


IMPOSSIBLE = [
    ("rubber.density_kg_m3", 1.12),
    ("rubber.specific_heat_J_kgK", 1.75),
    ("rubber.tread_thickness_m", 12e-6),
    *((key, 1e-308) for key in (
        "track.width_m", "friction.stiffness_Nm_per_deg", "rubber.density_kg_m3", "rubber.specific_heat_J_kgK",
        "rubber.tread_thickness_m", "rubber.contact_area_m2",
    )),
]  # fmt: skip


@pytest.mark.parametrize(("key", "value"), IMPOSSIBLE)
def test_what_no_matter_can_be_is_refused(key: str, value: float) -> None:
    with pytest.raises(VehicleFileError, match=f"key '{key}': got"):
        from_mapping(changed(SHEET, key, value), FILE)


UNLIKELY = [
    ("friction.stiffness_Nm_per_deg", 5393.7e3),  # N m/deg from N mm/deg
    ("friction.stiffness_Nm_per_deg", 5.3937),  # from kN m/deg
    ("rubber.density_kg_m3", 112.0),
    ("rubber.specific_heat_J_kgK", 418.0),  # from kcal
    ("rubber.tread_thickness_m", 0.0012),
    ("rubber.contact_area_m2", 42.0),  # from dm2
    ("rubber.contact_area_m2", 0.0042),
    ("track.weight_N", 62e3),
    ("track.yaw_inertia_kgm2", 0.095),  # from t m2
    ("axle.load_N", 90.0),  # from kN
    ("axle.kingpin_inclination_deg", 40.0),
    ("friction.reference_temperature_degC", -60.0),
    ("sensors.pressure_range_Pa", 25e3),  # from kPa
    ("sensors.pressure_noise_Pa", 1.5e7),
    ("initial.air_temperature_degC", 77.0),  # from F
]


@pytest.mark.parametrize(("key", "value"), UNLIKELY)
def test_what_no_real_vehicle_has_is_doubted_and_loads(key: str, value: float) -> None:
    doubts = plausibility(from_mapping(changed(SHEET, key, value), FILE))
    assert key in [doubt.key for doubt in doubts]
    assert all("unlike any real vehicle" in doubt.statement for doubt in doubts)


def test_other_rigs_may_be_of_any_size() -> None:
    tiny = changed(changed(JOINT, "contact.static_torque_Nm", 1.2e-9), "contact.coulomb_torque_Nm", 1e-9)
    assert plausibility(from_mapping(changed(tiny, "contact.stiffness_Nm_per_deg", 1e-9), FILE)) == ()


def test_doubts_are_told_once_on_stderr_and_stand_in_the_result(tmp_path: Path) -> None:
    text = FILE.read_text().replace("1120.0", "112.0").replace("rubber_dma", f"{CONFIG}/rubber_dma")
    (tmp_path / "odd.yaml").write_text(text)
    drive = "segments: [{hold: {duration_s: 1.0}}, {sweep: {to_deg: 1.0, rate_deg_s: 2.0}}]"
    (tmp_path / "drive.yaml").write_text(drive)
    odd, out = str(tmp_path / "odd.yaml"), str(tmp_path / "out")
    done = CliRunner().invoke(app, ["vehicle", odd, "--json"])
    (told,) = json.loads(done.stdout)["warnings"]
    assert (told["key"], told["value"]) == ("rubber.density_kg_m3", 112.0)
    assert done.stderr == f"lugre-steering: warning: {odd}: {told['statement']}\n"
    assert CliRunner().invoke(app, ["simulate", str(tmp_path / "drive.yaml"), "--vehicle", odd, "--out", out]).stderr == done.stderr
    with pytest.warns(ImplausibleWarning, match="112 kg/m3"):
        load(odd)


# ------------------------------------------------------------------ numbers


@pytest.mark.parametrize("number", ["010", "1:30", "0x10", "1_000", "00.5", "0b1", "1e", "+-1"])
def test_a_number_that_could_be_another_is_refused(tmp_path: Path, number: str) -> None:
    file = tmp_path / "v.yaml"
    text = FILE.read_text().replace("rubber_dma", f"{CONFIG}/rubber_dma")
    file.write_text(text.replace("damping_ratio: 0.5", f"damping_ratio: {number}"))
    with pytest.raises(VehicleFileError, match=r"'track\.damping_ratio': got .*expected a plain number"):
        load(file)


@pytest.mark.parametrize("number", ["1", "+1", "1.0", "1.", "0.1e1", "10e-1", "1E0", ".5e+0", "1.e0"])
def test_decimal_numbers_are_what_they_show(tmp_path: Path, number: str) -> None:
    (tmp_path / "n.yaml").write_text(f"a: {number}")
    assert Reader(tmp_path / "n.yaml", VehicleFileError).load() == {"a": float(number)}


def test_what_stands_in_a_file_named_as_table_is_not_shown(tmp_path: Path) -> None:
    (tmp_path / "shadow").write_text("root:$6$secret:19000\n")
    with pytest.raises(VehicleFileError) as caught:
        from_mapping(changed(SHEET, "rubber.dma_csv", "shadow"), tmp_path / "v.yaml")
    assert "secret" not in str(caught.value)
    assert "temperature_degC" in str(caught.value)


# -------------------------------------------------------------------- fuzz


PARAMETERS = (CONFIG / "estimator_parameters.yaml").read_bytes()
DRIVE = b"segments: [{hold: {duration_s: 1.0}}, {sweep: {to_deg: 1.0, rate_deg_s: 2.0}}]\n"
PIECES = [b"&a ", b"*a", b"<<: ", b"[", b"]", b"{", b"}", b"- ", b"? ", b": ", b"!!int ", b"!x ", b"|\n", b"'", b'"', b"...\n", b"---\n",
          b"%YAML 1.1\n", b"1e999", b"-0", b".nan", b"~", b"=", b"2020-01-01", b"\t", b"\xef\xbb\xbf", b"\x85", b"# "]  # fmt: skip
hostile = st.lists(st.tuples(st.integers(0, 4000), st.sampled_from(PIECES) | st.binary(max_size=6)), min_size=1, max_size=4)


@settings(max_examples=150)
@given(st.sampled_from([(FILE.read_bytes(), load), (PARAMETERS, read_options), (DRIVE, from_yaml)]), hostile)
def test_any_text_gives_a_result_or_one_line(given: tuple[bytes, Callable[[Path], Any]], inserted: list[tuple[int, bytes]]) -> None:
    """Vehicle, parameter and manoeuvre files with YAML's own signs put anywhere."""
    text, read = given
    for at, piece in inserted:
        at %= len(text)
        text = text[:at] + piece + text[at:]
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", ImplausibleWarning)
        shutil.copy(CONFIG / "rubber_dma_10hz.csv", folder)
        (Path(folder) / "f.yaml").write_bytes(text)
        said = "f.yaml"
        try:
            read(Path(folder) / "f.yaml")
        except LugreSteeringError as error:
            said = str(error)
    assert "f.yaml" in said
    assert "\n" not in said


@settings(max_examples=150)
@given(st.sampled_from([path for path in paths(SHEET) if not isinstance(path[-1], int)]), st.floats() | st.integers(-(10**40), 10**40))
def test_any_number_anywhere_gives_a_finite_sheet_or_one_line(path: tuple[Any, ...], number: float) -> None:
    sheet = copy.deepcopy(SHEET)
    node = sheet
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = number
    with suppress(VehicleFileError):
        json.dumps(derive(from_mapping(sheet, FILE)), allow_nan=False)
