# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Scores against answers worked out by hand; the campaign has what it must; one blind run from end to end."""

from __future__ import annotations

import functools
import json
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from bag_making import SLOWEST, slowly_sampled
from hypothesis import given
from hypothesis import strategies as st
from proof_page import page_lines
from typer.testing import CliRunner

from lugre_steering.cli import app
from lugre_steering.errors import DataError
from lugre_steering.proof import blind, campaign, command, journal, manoeuvres, scoreboard, scores, simulator, sizing
from lugre_steering.proof.conceal import EFFECT_IDS, UNLISTED_IDS
from lugre_steering.proof.result import HowMade, Scoreboard
from lugre_steering.schemas import schema_of
from lugre_steering.serialise import plain

Row = dict[str, Any]

ROOT = Path(__file__).resolve().parents[2]
SHEET_FILE = ROOT / "config" / "test_vehicle.yaml"
KEPT_BOARD = ROOT / "config" / "proof_scoreboard.json"


def effect(name: str, ties: Sequence[str] = (), spans: Sequence[Sequence[float]] = (), **parameters: tuple[float, float]) -> Row:
    """A reported effect; parameters are (value, half width of the interval)."""
    return {
        "id": name, "indistinguishable_from": list(ties), "energy_share": 0.9, "masked_share": 0.1, "p_value": 0.01,
        "where": [{"bag": "run_a", "intervals_s": [list(span) for span in spans]}],
        "parameters": {k: {"value": v, "ci95": [v - d, v + d], "unit": "1"} for k, (v, d) in parameters.items()},
    }  # fmt: skip


def row(
    hidden: Sequence[str], verdict: str, *reported: Row, kind: str = "single", ratio: float = 1.0, rmse: tuple[float, float] = (20.0, 10.0)
) -> Row:
    """A finished case: bags of 100 s, the first effect acts from 10 to 30 s of run_a; noise variance as seen 36."""
    spans = {name: [[10.0, 30.0]] for name in hidden}
    parameters = {"torque": 400.0, "b": 100.0, "line": "aux_a", "offset": 5e4}
    bag = {"manoeuvre": "sweeps", "duration_s": 100.0, "removable_variance": 500.0, "noise_variance": 40.0, "seen_noise_variance": 36.0}
    return {
        "name": f"{kind}/{'+'.join(hidden)}/{verdict}/{len(reported)}", "kind": kind,
        "simulator": 2, "mistake": {}, "noise": "white", "seed": 3, "version": "v",
        "wanted_ratio": ratio, "ratio": ratio if hidden else 0.0, "masked": 0.2, "removable_variance": 400.0,
        "strengths": [1.0] * len(hidden), "error": None,
        "ratio_beside": dict.fromkeys(hidden, ratio) if len(hidden) > 1 else {},
        "seconds": {"making": 1.0, "diagnosis": 5.0},
        "truth": {
            "effects": [{"id": name, "only_bag": None, "parameters": parameters} for name in hidden],
            "bags": {"run_a": {**bag, "intervals_s": spans}, "run_b": {**bag, "intervals_s": {}}},
        },
        "diagnosis": {
            "verdict": verdict, "noise_floor_Nm": 6.0, "effects": list(reported),
            "baseline": {"rmse_Nm": rmse[0], "heldout_rmse_Nm": rmse[0]}, "augmented": {"rmse_Nm": rmse[1], "heldout_rmse_Nm": rmse[1]},
            "unexplained": {"structured": False, "where": None}, "findings": [], "laws": [],
        },
    }  # fmt: skip


FOUND = "missing_physics"
MADE = HowMade(True, "lugre-steering prove", 3, "2026-01-01", 11, "ab12", {"lugre_steering": "0"})
RUBBER = {2: "rubber_dma_10hz.csv", 3: "rubber.csv"}


@pytest.mark.parametrize(
    ("hits", "of", "low", "high"),
    [(9, 10, 0.5958, 0.9821), (0, 10, 0.0, 0.2775), (95, 100, 0.8882, 0.9785), (0, 0, 0.0, 1.0)],
)
def test_wilson_interval_has_the_tabulated_values(hits: int, of: int, low: float, high: float) -> None:
    assert scores.interval(hits, of) == pytest.approx((low, high), abs=1e-4)


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        (row(["slope_bias"], FOUND, effect("slope_bias")), "right name"),
        (row(["slope_bias"], FOUND, effect("slope_bias", ties=["pressure_offset"])), "right name"),
        (row(["slope_bias"], FOUND, effect("pressure_offset", ties=["slope_bias"])), "right tie"),
        (row(["slope_bias"], FOUND, effect("slope_bias"), effect("backlash")), "extra name"),
        (row(["slope_bias"], FOUND, effect("backlash", ties=["end_stop"])), "wrong name"),
        (row([], FOUND, effect("backlash"), kind="null"), "wrong name"),
        (row(["slope_bias"], "consistent"), "silent"),
        (row(["slope_bias"], "unlisted_physics"), "unlisted"),
        (row(["slope_bias"], "insufficient_data"), "insufficient data"),
        ({**row(["slope_bias"], FOUND), "diagnosis": None, "error": "crash"}, "failed"),
    ],
)
def test_outcome(case: Row, expected: str) -> None:
    assert scores.outcome(case) == expected


@pytest.mark.parametrize(
    ("reported", "expected"),
    [
        ([effect("end_stop"), effect("backlash")], 2),
        ([effect("soil_shear", ties=["end_stop"]), effect("backlash")], 2),
        ([effect("end_stop", ties=["backlash"])], 1),  # one answer cannot stand for both
        ([effect("end_stop", ties=["backlash"]), effect("backlash")], 2),
        ([effect("end_stop"), effect("slope_bias")], 1),
        ([effect("slope_bias")], 0),
    ],
)
def test_several_need_an_answer_each(reported: list[Row], expected: int) -> None:
    assert scores.answered(row(["end_stop", "backlash"], FOUND, *reported, kind="pair")) == expected


def test_location_is_intersection_over_union_of_all_bags() -> None:
    case = row(["end_stop"], FOUND, effect("end_stop", spans=[(20.0, 40.0)]))
    assert scores.location(case) == pytest.approx(10.0 / 30.0)
    case["truth"]["bags"]["run_b"]["intervals_s"] = {"end_stop": [[0.0, 30.0]]}  # missed altogether
    assert scores.location(case) == pytest.approx(10.0 / 60.0)
    case["truth"]["bags"]["run_b"]["intervals_s"] = {"end_stop": [[0.0, 100.0]]}  # acts in 120 of 200 s: not local
    assert scores.location(case) is None
    assert scores.location(row(["end_stop"], "consistent")) is None


SPANS = st.lists(st.tuples(st.integers(0, 40), st.integers(1, 10)).map(lambda t: (t[0], t[0] + t[1])), min_size=1, max_size=4)


@given(SPANS, SPANS)
def test_overlap_counts_seconds_like_a_raster(one: list[tuple[int, int]], other: list[tuple[int, int]]) -> None:
    seconds = [{s for a, b in spans for s in range(a, b)} for spans in (one, other)]
    assert scores.overlap(one, other) == (len(seconds[0] & seconds[1]), len(seconds[0] | seconds[1]))


def test_parameter_errors_use_the_meaning_not_the_number() -> None:
    case = row(["line_loss_linear"], FOUND, effect("line_loss_linear", b=(55.0, 6.0)))
    assert scores.parameter_errors(case) == {"line_loss_linear.b": (pytest.approx(0.1), True)}  # 100 of two tracks, 55 of one
    line = row(["pressure_offset"], FOUND, effect("pressure_offset", aux_a=(4e4, 1e3)))
    assert scores.parameter_errors(line) == {"pressure_offset.line": (pytest.approx(0.2), False)}
    elsewhere = row(["pressure_offset"], FOUND, effect("pressure_offset", main_b=(5e4, 1e3)))
    assert scores.parameter_errors(elsewhere) == {}
    assert scores.parameter_errors(row(["slope_bias"], FOUND, effect("pressure_offset", ties=["slope_bias"]))) == {}
    stop = row(["end_stop"], FOUND, effect("end_stop", engage_angle=(0.5, 0.01), stiffness=(1e4, 10.0), cubic_stiffness=(4e6, 10.0)))
    stop["truth"]["effects"][0]["parameters"] = {"threshold": 0.5, "k1": 2e4, "k3": 0.0}  # both reach 1000 N m after 0.05 rad
    errors = scores.parameter_errors(stop)
    assert errors == {"end_stop.engage_angle": (0.0, True), "end_stop.secant": (pytest.approx(0.0), None)}
    jacking = row(["kingpin_jacking"], FOUND, effect("kingpin_jacking", amplitude=(100.0, 1.0), second_harmonic=(70.0, 1.0)))
    jacking["truth"]["effects"][0]["parameters"] = {"amplitude": 200.0, "caster_share": 0.4}  # slopes 240 and 200 N m/rad
    assert scores.parameter_errors(jacking) == {"kingpin_jacking.slope": (pytest.approx(0.2), None)}


def test_removed_is_the_share_of_what_noise_does_not_explain() -> None:
    assert scores.removed(row(["slope_bias"], FOUND, effect("slope_bias"))) == pytest.approx((400 - 100) / (400 - 36))
    assert scores.removed(row(["slope_bias"], "consistent", rmse=(6.1, 6.1))) is None


def test_board_counts_and_serialises() -> None:
    rows = [
        *(row([], "consistent", kind="null") for _ in range(3)), row([], FOUND, effect("backlash"), kind="null"),
        row(["slope_bias"], FOUND, effect("slope_bias", torque=(410.0, 20.0))), row(["slope_bias"], "consistent", ratio=0.1),
        row(["backlash"], FOUND, effect("end_stop")),
        row(["end_stop", "backlash"], FOUND, effect("end_stop"), effect("backlash"), kind="pair"),
        row(["end_stop", "slope_bias"], FOUND, effect("end_stop"), kind="pair") | {"ratio_beside": {"end_stop": 1.0, "slope_bias": 0.02}},
        row(["body_mode"], "unlisted_physics", kind="unlisted"), row(["body_mode"], FOUND, effect("backlash"), kind="unlisted"),
    ]  # fmt: skip
    result = scoreboard.board(rows, MADE)
    whole = json.loads(result.to_json())
    assert whole == result.json
    board = whole["simulators"]["2"]
    assert board["nulls"]["silent"]["share"] == 0.75
    assert board["nulls"]["named"] == {"backlash": 1}
    assert board["naming"]["from_0.3"] == {"share": 0.5, "hits": 1, "of": 2, "ci95": list(scores.interval(1, 2))}
    assert board["power"][0]["detected"]["share"] == 0.0
    assert board["naming"]["confusion"] == {
        "slope_bias": {"slope_bias": 1}, "backlash": {"end_stop": 1}, "body_mode": {"unlisted": 1, "backlash": 1},
    }  # fmt: skip
    assert board["pairs"]["all"]["share"] == 0.5
    assert board["pairs"]["all_from_0.3"] == {"share": 1.0, "hits": 1, "of": 1, "ci95": list(scores.interval(1, 1))}
    assert board["unlisted"]["called_unlisted"]["share"] == 0.5
    assert board["effects"]["backlash"]["taken_for"] == {"end_stop": 1}
    status = {target["id"]: target["status"] for target in board["targets"]}
    assert {key for key, value in status.items() if value == "met"} == {"seconds"}  # eleven cases prove nothing else
    assert status["nulls_silent"] == "not met"  # but 3 of 4 is out of reach of 0.98
    assert "dirty_silent" not in status


@functools.cache
def validator() -> jsonschema.Draft202012Validator:
    schema = schema_of(Scoreboard)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def refusals(board: Row) -> list[str]:
    """What the schema of scoreboard.json has against it."""
    return [error.json_path for error in validator().iter_errors(board)]


def test_the_record_keeps_to_its_schema() -> None:
    peer = {"before": 136.0, "after": 86.0, "alarm": True, "names": ["slope_bias"], "seconds": 1.0}
    rows = [
        row([], "consistent", kind="null"), {**row(["slope_bias"], FOUND, effect("slope_bias")), "peers": {"SINDy ensemble": peer}},
        {**row(["backlash"], FOUND), "diagnosis": None, "error": "crash"}, row(["body_mode"], "unlisted_physics", kind="unlisted"),
    ]  # fmt: skip
    for board in (scoreboard.board(rows, MADE).json, scoreboard.board([], MADE).json):
        assert refusals(board) == []
    board = scoreboard.board(rows, MADE).json
    part = board["simulators"]["2"]
    for key in part:
        less = {name: value for name, value in part.items() if name != key}
        assert refusals({**board, "simulators": {"2": less}}) == ["$.simulators['2']"], key
    naming = {**part["naming"], "from_0.3": {"share": "most", "hits": 1, "of": 1, "ci95": [0.0, 1.0]}}
    assert refusals({**board, "simulators": {"2": {**part, "naming": naming}}}) == ["$.simulators['2'].naming['from_0.3'].share"]
    assert refusals({**board, "schema": "lugre_steering/scoreboard/1"}) == ["$.schema"]


def test_simulators_are_never_pooled() -> None:
    rows = [row([], "consistent", kind="null"), row([], FOUND, effect("backlash"), kind="null") | {"simulator": 3}]
    board = scoreboard.board(rows, MADE).json
    assert board["simulators"]["2"]["nulls"]["silent"]["share"] == 1.0
    assert board["simulators"]["3"]["nulls"]["silent"]["share"] == 0.0
    assert "nulls" not in board


def test_wrong_sheet_counts_with_a_right_suspect_among_three_and_no_name() -> None:
    case = row([], "insufficient_data", kind="sheet") | {"mistake": {"what": "load x 0.1", "suspects": ["load_N"]}}

    def told(suspects: list[str], *reported: Row) -> bool:
        found = {**case["diagnosis"], "findings": [{"finding": "wrong_sheet", "suspects": suspects}], "effects": list(reported)}
        return scores.sheet_told({**case, "diagnosis": found})

    assert told(["friction.coulomb", "axle.load_N"])
    assert told([{"key": "axle.load_N", "factor": 0.1}])  # type: ignore[list-item]
    assert not told(["friction.coulomb", "friction.static", "hydraulics.cylinders.left_a.bore_m", "axle.load_N"])
    assert not told(["axle.load_N"], effect("surface_patch"))
    assert not scores.sheet_told(case)


def test_generated_laws_and_dirt_have_scores_of_their_own() -> None:
    law = {"strength": 1.0, "channel": "gain", "coordinate": "time", "memory": "lag", "shape": "wave", "outside": ""}
    cases = [row(["law"], "unlisted_physics", kind="law"), row(["law"], FOUND, effect("backlash"), kind="law")]
    for case in cases:
        case["truth"]["effects"][0]["parameters"] = law
    cases[0]["unseen"] = {"baseline_Nm": 100.0, "augmented_Nm": 68.0, "floor_Nm": 60.0}
    cases[1]["unseen"] = {"baseline_Nm": 100.0, "augmented_Nm": 112.0, "floor_Nm": 60.0}
    dirty = [row([], "insufficient_data", kind="dirty"), row([], FOUND, effect("relief_saturation"), kind="dirty")]
    part = plain(scoreboard.part([*cases, *dirty]))
    assert part["laws"]["called_unlisted"]["hits"] == 1
    assert part["laws"]["inside_grammar"]["of"] == 2
    assert part["laws"]["outside_grammar"]["of"] == 0
    assert part["laws"]["foretold"]["median"] == pytest.approx(0.5 * (5376.0 - 2544.0) / 6400.0)  # of what hiding adds
    assert part["laws"]["harmed"]["hits"] == 1
    assert part["dirty"]["silent"]["share"] == 0.5
    assert part["dirty"]["named"] == {"relief_saturation": 1}


def test_what_stands_in_place_of_an_entry_is_scored_against_it() -> None:
    """Of a noise of 6 N m, 20 N m before and 10 N m with the entry: 12 N m without it is 256 of 300 (N m)^2, nothing found none of them."""
    rows, unlisted, silent = [], "unlisted_physics", "consistent"
    for named, verdict, after in (("end_stop", unlisted, 12.0), ("end_stop", silent, 20.0), ("backlash", silent, 20.0)):
        case = row(["end_stop"], FOUND, effect(named), kind="without", rmse=(20.0, 10.0))
        rows.append(case | {"without": row(["end_stop"], verdict, kind="without", rmse=(20.0, after))["diagnosis"]})
    assert [scores.removed_without(case) for case in rows] == [pytest.approx(256.0 / 300.0), 0.0, None]
    shown = scoreboard.part(rows).without
    assert (shown.enough.hits, shown.enough.of, shown.removed.of) == (0, 2, 2)


def test_measured_quantities_are_scored_beside_coefficients() -> None:
    case = row(["end_stop"], FOUND, effect("end_stop")) | {
        "measured": {"end_stop": {"what": "angle", "unit": "rad", "true": 0.5, "value": 0.52, "ci95": [0.51, 0.53]}}
    }
    assert scores.measured_errors(case) == {"end_stop": (pytest.approx(0.04), False)}
    part = scoreboard.part([case])
    assert part.measurable.interval_covers.share == 0.0
    assert part.measurable.half_width.median == pytest.approx(0.02)


def test_empty_board_meets_and_misses_nothing() -> None:
    assert scoreboard.part([]).targets == ()


def test_peers_are_judged_by_the_same_noise(tmp_path: Path) -> None:
    entry = {"before": 136.0, "after": 86.0, "alarm": True, "names": ["slope_bias", "pressure_offset"], "seconds": 1.0}
    rows = [
        {**row(["slope_bias"], FOUND, effect("slope_bias")), "peers": {"SINDy ensemble": entry}},
        {**row([], "consistent", kind="null"), "peers": {"SINDy ensemble": entry}},
    ]
    how = {"seed": 1, "date": "2026-01-01", "vehicle": {"path": "test_vehicle.yaml", "sha256": {"test_vehicle.yaml": "ab12"}}}
    board = scoreboard.board(rows, MADE).json | {"made": how}
    part = board["simulators"]["2"]
    peer = part["peers"]["SINDy ensemble"]
    assert peer["removed"]["median"] == pytest.approx(0.5)
    assert peer["false_alarms"]["share"] == 1.0
    assert peer["named"]["share"] == 1.0
    assert part["peers"]["lugre_steering"]["false_alarms"]["share"] == 0.0
    pytest.importorskip("matplotlib")
    from PIL import Image

    from lugre_steering.proof.figures import draw_all

    files = draw_all(board, tmp_path)
    assert {file.stem for file in files} == {f"proof_{name}" for name in ("power", "confusion", "location", "effects", "peers")}
    assert all(file.stat().st_size > 5000 for file in files)
    for file in files:
        with Image.open(file) as picture:
            assert re.search(r"prove, 2026-01-01\noptions: seed = 1\nvehicle .*ab12$", picture.info["Comment"])


@pytest.mark.parametrize("simulator", [2, 3])
def test_campaign_covers_every_effect_size_and_disguise(simulator: int) -> None:
    cases = campaign.campaign(7, (simulator,))
    assert {case.simulator for case in cases} == {simulator}
    kinds = {kind: [case for case in cases if case.kind == kind] for kind in {case.kind for case in cases}}
    effects = EFFECT_IDS if simulator == 2 else campaign.FIELD_IDS
    ratios = (0.1, 0.3, 1.0, 10.0) if simulator == 2 else (0.3, 1.0, 10.0)
    assert {(case.effects[0], case.ratio) for case in kinds["single"]} == {(name, ratio) for name in effects for ratio in ratios}
    assert {case.effects[0] for case in kinds["one-bag"]} == set(effects)
    assert all(len(kinds[disguise]) >= 30 for disguise in ("one-bag", "late", "barely"))
    assert len({case.effects for case in kinds["pair"]}) >= 20
    assert all(len(set(case.effects)) == 3 for case in kinds["triple"])
    assert len(kinds["law"]) >= 30
    assert len({case.name for case in cases}) == len(cases) == len({case.seed for case in cases})
    if simulator == 2:
        assert len(kinds["null"]) >= 100
        assert {case.noise for case in kinds["null"]} == {"white", "coloured", "ripple"}
        assert {case.effects[0] for case in kinds["unlisted"]} == set(UNLISTED_IDS)
        assert {case.effects[0] for case in kinds["without"]} == set(effects)
    else:
        assert len(effects) >= 12
        assert len(kinds["dirty"]) >= 100
        assert len(kinds["sheet"]) >= 60
        assert {case.which % 9 for case in kinds["sheet"]} == set(range(9))


def test_kinds_and_simulator_of_the_command(tmp_path: Path) -> None:
    cases = campaign.of_kinds(campaign.campaign(7), "dirty,sheet")
    assert {case.kind for case in cases} == {"dirty", "sheet"}
    for words, expected in ((["--kinds", "dirty,nulls"], "no kind"), (["--simulator", "4"], "2, 3, all")):
        result = CliRunner().invoke(app, ["prove", "--out", str(tmp_path), *words])
        assert result.exit_code == 2
        assert expected in result.stderr
    with pytest.raises(DataError, match="no such cases"):
        campaign.of_kinds(campaign.campaign(7, (2,)), "dirty")


def test_the_command_says_how_its_board_came_about(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = [row([], "consistent", kind="null"), row(["slope_bias"], FOUND, effect("slope_bias"))]
    monkeypatch.setattr(command, "run_all", lambda *_, **__: cases)
    told = CliRunner().invoke(app, ["prove", "--out", str(tmp_path), "--seed", "7", "--cases", "null/*", "--json"])
    assert told.exit_code == 0, told.stderr
    board = json.loads(told.stdout)
    assert board == json.loads((tmp_path / "scoreboard.json").read_text(encoding="utf-8"))
    assert refusals(board) == []
    made, origin = board["made"], board["provenance"]
    assert (made["seed"], made["vehicle"]["path"], origin["command"]) == (7, "test_vehicle.yaml", "prove")
    assert origin["options"] == {"command": made["command"], "seed": 7, "source": made["source"]}
    assert origin["vehicle"] == made["vehicle"]


def test_campaign_repeats_with_its_seed_only() -> None:
    assert campaign.campaign(7) == campaign.campaign(7)
    assert not {case.seed for case in campaign.campaign(7)} & {case.seed for case in campaign.campaign(8)}
    some = campaign.matching(campaign.campaign(7), "single/end_stop/*")
    assert {case.effects for case in some} == {("end_stop",)}
    assert set(some) <= set(campaign.campaign(7))


def test_a_sample_has_some_of_every_kind_of_each_simulator_and_others_with_another_seed() -> None:
    cases = campaign.campaign(7)
    few = campaign.sampled(cases, 3)
    counted = Counter((case.simulator, case.kind) for case in few)
    assert set(counted) == {(case.simulator, case.kind) for case in cases}
    assert set(counted.values()) == {3}
    assert len({(case.simulator, case.kind) for case in few[: len(counted)]}) == len(counted)  # cut short it still has all
    assert {case.name for case in few} != {case.name for case in campaign.sampled(campaign.campaign(8), 3)}


def test_quick_has_every_kind_and_different_effects() -> None:
    few = campaign.quick(campaign.campaign(7))
    assert {case.kind for case in few[: len(campaign.QUICK)]} == set(campaign.QUICK)
    singles = [case.effects for case in few if case.kind == "single"]
    assert len(set(singles)) == len(singles) == campaign.QUICK["single"]


def test_unknown_case_pattern_is_one_line_and_code_2(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no case has such a name"):
        campaign.matching(campaign.campaign(7), "single/unicorn/*")
    result = CliRunner().invoke(app, ["prove", "--out", str(tmp_path), "--cases", "single/unicorn/*"])
    assert result.exit_code == 2
    assert not list(tmp_path.iterdir())


def test_resume_keeps_finished_cases_of_the_same_code(tmp_path: Path) -> None:
    file, version = tmp_path / "cases.jsonl", blind.source_version()
    cases = campaign.matching(campaign.campaign(7), "null/white/0*")[:2]
    done = [{**row([], "consistent", kind="null"), "name": case.name, "seed": case.seed, "version": version} for case in cases]
    lines = [json.dumps(entry) for entry in done]
    file.write_text("\n".join(lines) + "\n" + lines[0][:50], encoding="utf-8")  # the last one was cut off
    assert journal.run_all(cases, SHEET_FILE, file) == done
    other = json.dumps({**done[0], "version": "older code"})
    failed = json.dumps({**done[1], "error": "crash", "diagnosis": None})
    file.write_text(f"{other}\n{failed}\n", encoding="utf-8")
    assert journal.finished(file, version, set()) == {}
    file.write_text(lines[0] + "\n", encoding="utf-8")
    assert journal.finished(file, version, {cases[0].name}) == {}  # peers have not run yet


@pytest.fixture
def _short_manoeuvres(monkeypatch: pytest.MonkeyPatch) -> None:
    """Under a minute with both limits, holds and small reversals."""

    def short(rng: np.random.Generator) -> Any:
        targets = manoeuvres.LIMIT_RAD * np.array([0.98, -0.98, 0.3, 0.2, 0.35, -0.1, 0.95, 0.0])
        return manoeuvres._sweep_to(targets, np.deg2rad(rng.uniform(6.0, 9.0, 8)), rng.uniform(1.0, 4.0, 8))

    monkeypatch.setattr(manoeuvres, "KINDS", {"short": short, "brief": short})


@pytest.mark.usefixtures("_short_manoeuvres")
def test_effects_are_scaled_to_the_wanted_ratio() -> None:
    for name, ratio in (("end_stop", 0.3), ("slope_bias", 10.0), ("distributed_contact", 0.3)):
        made, _ = sizing.make(campaign.Hiding("x", "single", (name,), ratio, "white", 11), SHEET_FILE)
        reached = blind.recalibrated(made) / blind.pooled_noise(made)
        assert 0.75 < reached / ratio < 1.3


@pytest.mark.usefixtures("_short_manoeuvres")
@pytest.mark.parametrize("simulator", [2, 3])
def test_diagnosis_sees_bags_and_sheet_alone(simulator: int, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[str, Any] = {}

    def look(command: list[str], **_options: Any) -> Any:
        vehicle = Path(command[command.index("--vehicle") + 1])
        seen["files"] = sorted(str(file.relative_to(vehicle.parent)) for file in vehicle.parent.rglob("*") if file.is_file())
        seen["command"] = command
        seen["text"] = b"".join(file.read_bytes() for file in vehicle.parent.rglob("*") if file.is_file())
        raise blind.subprocess.TimeoutExpired(command, 1.0)

    monkeypatch.setattr(blind.subprocess, "run", look)
    monkeypatch.setattr(sizing, "_sized", lambda wanted, *_: wanted)  # of any size, as nothing is judged
    case = campaign.Hiding("single/end_stop/1/0", "beside", ("end_stop",), 1.0, "white", 11, simulator=simulator)
    result = blind.run(blind.Job(case, SHEET_FILE, "v", peers=False))
    assert result["error"] is not None
    assert scores.outcome(result) == "failed"
    assert [file for file in seen["files"] if not file.startswith("bags")] == [RUBBER[simulator], "vehicle.yaml"]
    assert not any("end_stop" in word or "truth" in word for word in seen["command"])
    assert b"end_stop" not in seen["text"].replace(SHEET_FILE.read_bytes(), b"")


@pytest.mark.usefixtures("_short_manoeuvres")
def test_blind_end_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Recordings as slow as those of the field, which are quicker to diagnose."""
    write = simulator.write_case
    monkeypatch.setattr(simulator, "write_case", lambda data, *folders: write(slowly_sampled(data, stride=SLOWEST), *folders))
    stop = campaign.Hiding("single/end_stop/10/0", "single", ("end_stop",), 10.0, "white", 11)
    found = blind.run(blind.Job(stop, SHEET_FILE, "v", peers=False))
    assert found["error"] is None
    assert scores.outcome(found) in scores.RIGHT


@pytest.mark.skipif(not KEPT_BOARD.exists(), reason="no full run has been kept yet")
def test_the_kept_scoreboard_keeps_to_the_schema_and_is_told_whole() -> None:
    """As it was written before results of this command had types: nothing of it is lacking, and nothing more."""
    kept = json.loads(KEPT_BOARD.read_text(encoding="utf-8"))
    assert refusals(kept) == []
    now = scoreboard.board([row([], "consistent", kind="null")], MADE).json
    (part,) = now["simulators"].values()
    for theirs, ours in ((kept, now), *((each, part) for each in kept["simulators"].values())):
        assert [*theirs, *(["provenance"] if ours is now and "provenance" not in theirs else [])] == list(ours)
    for each in kept["simulators"].values():
        assert {name: list(each[name]) for name in FIXED} == {name: list(part[name]) for name in FIXED}
        for name in ("masked", "power"):
            assert list(each[name][0]) == list(part[name][0])
        assert list(each["unlisted"]["by_ratio"][0]) == list(part["unlisted"]["by_ratio"][0])


FIXED = (
    "nulls", "naming", "location", "parameters", "measurable", "removed", "pairs", "triples", "unlisted", "laws", "dirty", "sheets",
    "beside", "without", "seconds_per_case",
)  # fmt: skip
"""Scores whose keys are always the same."""


@pytest.mark.skipif(not KEPT_BOARD.exists(), reason="no full run has been kept yet")
def test_the_guide_shows_the_kept_scoreboard() -> None:
    board = json.loads(KEPT_BOARD.read_text(encoding="utf-8"))
    if board["schema"] != scoreboard.SCHEMA:
        pytest.skip("the kept run is of an earlier scoreboard; docs/proof.md is remade with the next full run")
    page = (ROOT / "docs/proof.md").read_text(encoding="utf-8")
    missing = [line for line in page_lines(board) if line not in page]
    assert not missing, "docs/proof.md differs from config/proof_scoreboard.json; it must have these lines:\n" + "\n".join(missing)
    assert board["made"]["command"] in page
