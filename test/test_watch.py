# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The online watch: alarms on made-up scores, and window files there and back."""

from __future__ import annotations

import io
import json
import math
import zipfile
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lugre_steering.bench.neighbour import Strokes
from lugre_steering.cli import app
from lugre_steering.errors import DataError
from lugre_steering.provenance import provenance
from lugre_steering.recording import Array
from lugre_steering.vehicle import load
from lugre_steering.watch.detector import SCORES, STATE, THRESHOLD, UNCALIBRATED, Watch, weigh
from lugre_steering.watch.window import CAPACITY, SAMPLE, SampleRing, part_since, read_window, write_window

FILE = Path(__file__).resolve().parents[1] / "config" / "test_vehicle.yaml"
VEHICLE = load(FILE)
MADE = provenance("node", {"watch_before_s": 30.0}, FILE)
T0 = 1_790_000_000_000_000_000


def coloured(count: int, seed: int) -> Array:
    """Scores (count, SCORES) with memory: an AR(1) of 0.5 about levels of their own."""
    rng, x = np.random.default_rng(seed), np.zeros((count, SCORES))
    for i in range(1, count):
        x[i] = 0.5 * x[i - 1] + 0.2 * rng.standard_normal(SCORES)
    return np.asarray(x + np.array([7.0, 0.0, 8.0]))


def sums(scores: Array) -> Array:
    state = np.zeros(1, STATE)[0]
    return np.array([weigh(state, row) for row in scores])


def test_scores_that_only_scatter_raise_no_alarm() -> None:
    assert sums(coloured(20_000, 1)).max() < THRESHOLD


@pytest.mark.parametrize("changed", [[0, 2], [0, 1, 2]])
def test_a_change_is_told_and_not_before(changed: list[int]) -> None:
    """More error and larger kicks, with another level or without."""
    scores = coloured(600, 2)
    scores[400:, changed] += 5.0 * 0.23
    level = sums(scores)
    assert level[:400].max() < THRESHOLD
    assert level[400:480].max() > THRESHOLD


def test_the_watch_learns_tells_once_and_knows_since_when() -> None:
    """Residuals of noise, five times as large from the 1500th second on; a stroke of 0.3 rad takes 3.5 s."""
    watch, rng, alarms = Watch(VEHICLE), np.random.default_rng(3), []
    for i in range(40_000):
        t = 0.05 * i
        watch.turned([0.3 * math.sin(0.9 * t)])
        if watch.add(T0 + round(t * 1e9), (2000.0 if t > 1500.0 else 400.0) * float(rng.standard_normal())):
            alarms.append(t)
            since_s = (watch.since_ns - T0) * 1e-9
    assert len(alarms) == 1
    assert 1500.0 < alarms[0] < 1600.0
    assert since_s == pytest.approx(1500.0, abs=60.0)


def test_a_change_that_lasts_is_not_what_is_usual_and_is_over_when_it_is_mended() -> None:
    watch, rng = Watch(VEHICLE), np.random.default_rng(5)
    unlike = []
    for i in range(50_000):
        t = 0.15 * i
        watch.turned([0.3 * math.sin(0.9 * t)])
        watch.add(T0 + round(t * 1e9), (2000.0 if 1000.0 < t < 6900.0 else 400.0) * float(rng.standard_normal()))
        unlike.append(watch.since_ns != 0)
    told = 0.15 * np.flatnonzero(unlike)
    assert told.min() == pytest.approx(1050.0, abs=50.0)
    assert told.size == pytest.approx((told.max() - told.min()) / 0.15, abs=2)  # all the time, though it is five times as long
    assert told.max() == pytest.approx(7000.0, abs=100.0)


def watched(watch: Watch, begin: int, end: int, changed_s: float) -> list[tuple[float, int]]:
    """Residuals of noise, larger from ``changed_s`` on, from one sample to another; when alarms began, and since when."""
    alarms = []
    for i in range(begin, end):
        t = 0.15 * i
        watch.turned([0.3 * math.sin(0.9 * t)])
        noise = float(np.random.default_rng(i).standard_normal())
        if watch.add(T0 + round(t * 1e9), (2000.0 if t > changed_s else 400.0) * noise):
            alarms.append((t, watch.since_ns))
    return alarms


def test_what_the_watch_has_learned_and_found_survives_a_restart() -> None:
    """One restarted before the change finds it as soon as one that is not; one restarted while it lasts knows since when it does."""
    whole, first = Watch(VEHICLE), Watch(VEHICLE)
    expected = watched(whole, 0, 9000, 900.0)
    assert len(expected) == 1
    assert not watched(first, 0, 5900, 900.0)
    resumed = Watch(VEHICLE)
    resumed.resume(json.loads(json.dumps(first.memory)))
    assert resumed.learned == first.learned > 60
    ((told_s, since_ns),) = watched(resumed, 5900, 9000, 900.0)
    assert told_s == pytest.approx(expected[0][0], abs=10.0)  # a manoeuvre that is under way is lost
    assert since_ns == pytest.approx(expected[0][1], abs=10_000_000_000)
    again = Watch(VEHICLE)
    again.resume(resumed.memory)
    assert again.since_ns == since_ns
    assert not watched(again, 9000, 9300, 900.0)  # which has been told
    assert again.learned == resumed.learned
    assert not watched(Watch(VEHICLE), 6100, 9000, 900.0)  # without, what is wrong is what is usual


@pytest.mark.parametrize("spoil", ["another form", "cut", "no text", "nothing"])
def test_what_another_version_of_the_watch_has_learned_is_refused(spoil: str) -> None:
    memory = dict(Watch(VEHICLE).memory)
    changed = {"another form": ("form", "[]"), "cut": ("record", memory["record"][:400]), "no text": ("record", "?")}
    memory = memory | dict([changed[spoil]]) if spoil in changed else {}
    watch = Watch(VEHICLE)
    with pytest.raises(DataError, match="the watch had learned"):
        watch.resume(memory)
    assert watch.memory == Watch(VEHICLE).memory


def test_the_watch_says_what_it_can_tell() -> None:
    """Without a calibration nothing tells a model that was wrong from the start; with one that is the bound of the residual."""
    watch, calibrated = Watch(VEHICLE), Watch(VEHICLE.replace(provenance={"heldout_rmse_Nm": 3000.0}))
    assert watch.words == f"changes once 60 manoeuvres have told what is usual (0 so far); {UNCALIBRATED}"
    assert calibrated.words == "changes once 60 manoeuvres have told what is usual (0 so far)"
    watched(calibrated, 0, 3000, 900.0)
    assert calibrated.words == "changes"
    assert (watch.bound_Nm, calibrated.bound_Nm) == (0.0, 15000.0)


def test_the_vehicle_steers_by_the_mean_of_its_sides() -> None:
    """Two sides that turn against each other go nowhere; one alone is all there is."""
    for angles, goes in (((0.3, -0.3), False), ((0.3, 0.1), True), ((0.3,), True)):
        watch = Watch(VEHICLE)
        for i in range(400):
            watch.turned([angle * math.sin(0.1 * i) for angle in angles])
            watch.add(T0 + i, 400.0)
        assert bool(watch.scores) == goes


def test_a_standing_vehicle_is_not_judged() -> None:
    watch, rng = Watch(VEHICLE), np.random.default_rng(4)
    for i in range(20_000):
        watch.turned([1e-4 * float(rng.standard_normal())])
        assert not watch.add(T0 + i, 1e5 * i)
    assert watch.scores == []


def filled(seconds: float) -> SampleRing:
    strokes, samples = Strokes(VEHICLE), SampleRing()
    for i in range(round(100 * seconds)):
        for channel, value in enumerate(strokes.at(0.01 * i).tolist()):
            samples.add(channel, T0 + i * 10_000_000, value, math.nan)
    return samples


def test_a_window_comes_back_as_it_was_written(tmp_path: Path) -> None:
    file, rows = tmp_path / "window.npz", filled(3.0).copy()
    write_window(file, VEHICLE, "marked", rows[rows["stamp_ns"] >= T0 + 1_000_000_000], MADE)
    window = read_window(file, VEHICLE.channels)
    assert window.reason == "marked"
    assert window.recording.start_ns == T0 + 1_000_000_000
    assert set(window.recording.pressure) == {"main_a", "main_b", "aux_a", "aux_b"}
    strokes = Strokes(VEHICLE)
    expected = [strokes.at(0.01 * i)[0] for i in range(100, 300)]
    assert window.recording.angle["left"].value.tolist() == expected
    assert window.recording.angle["left"].time_s[-1] == pytest.approx(1.99)


def test_the_ring_keeps_the_latest() -> None:
    samples = SampleRing()
    for i in range(CAPACITY + 10):
        samples.add(0, i + 1, float(i), math.nan)
    rows = samples.copy()
    assert rows.size == CAPACITY
    assert (rows["stamp_ns"][0], rows["stamp_ns"][-1]) == (11, CAPACITY + 10)


@pytest.mark.parametrize(("onset_s", "missed_s"), [(0.0, 0.0), (5.0, 5.0), (9.5, 0.5), (10.5, 0.0)])
def test_a_window_says_how_much_of_what_it_is_to_show_is_no_longer_kept(onset_s: float, missed_s: float) -> None:
    """The ring holds what came from 10 s on: of earlier it is empty, or has been filled anew."""
    samples, onset_ns = SampleRing(), T0 + round(onset_s * 1e9) if onset_s else 0
    for i in range(100):
        samples.add(0, T0 + 10_000_000_000 + i * 10_000_000, 0.0, math.nan)
    part = part_since(samples.copy(), T0 + round((onset_s - 0.2) * 1e9), onset_ns)
    assert part.missed_s == pytest.approx(missed_s)
    assert part.missing == (f"its samples begin {missed_s:.1f} s after that did: no more are kept" if missed_s else "")
    assert part.seconds == pytest.approx(0.99 - max(0.0, onset_s - 0.2 - 10.0))
    assert part_since(samples.copy(), T0 + 20_000_000_000, onset_ns).samples.size == 0


def test_bad_windows_are_refused_in_words(tmp_path: Path) -> None:
    file = tmp_path / "window.npz"
    write_window(file, VEHICLE, "marked", filled(1.0).copy(), MADE)
    whole = file.read_bytes()
    for content in (b"", b"no window", whole[: len(whole) // 2], whole[:200] + bytes(100) + whole[300:]):
        file.write_bytes(content)
        with pytest.raises(DataError, match="damaged"):
            read_window(file, VEHICLE.channels)
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        about = archive.read("about.npy")
    for header in (b"{'descr': (", b"  {\n {"):
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("about.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
        with pytest.raises(DataError, match="damaged"):
            read_window(file, VEHICLE.channels)
    claim = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        claim, {"descr": np.lib.format.dtype_to_descr(SAMPLE), "fortran_order": False, "shape": (10**12,)}
    )
    with zipfile.ZipFile(file, "w") as archive:  # more samples than any memory holds
        archive.writestr("about.npy", about)
        archive.writestr("samples.npy", claim.getvalue())
    with pytest.raises(DataError, match="damaged"):
        read_window(file, VEHICLE.channels)
    file.write_bytes(whole)
    with pytest.raises(DataError, match="expected"):
        read_window(file, load(FILE.with_name("single_joint_example.yaml")).channels)
    with pytest.raises(DataError, match="cannot be read"):
        read_window(tmp_path / "none.npz", VEHICLE.channels)


def test_diagnose_reads_a_window(tmp_path: Path) -> None:
    file = tmp_path / "window.npz"
    write_window(file, VEHICLE, "marked", filled(4.0).copy(), MADE)
    arguments = ["diagnose", "--vehicle", str(FILE), "--out", str(tmp_path / "out"), "--no-report"]
    done = CliRunner().invoke(app, [*arguments, "--window", str(file)])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "out" / "diagnosis.json").exists()
    assert '"window"' in (tmp_path / "out" / "diagnosis.json").read_text()
    assert CliRunner().invoke(app, arguments).exit_code == 2
    file.write_bytes(b"nothing")
    assert CliRunner().invoke(app, [*arguments, "--window", str(file)]).exit_code == 2
