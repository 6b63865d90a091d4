# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Results on disk: killed, cut, raced and planted; nothing of anybody else is lost, nothing half passes for whole."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lugre_steering.cli import app
from lugre_steering.effects.own import read_effects
from lugre_steering.errors import DataError, EffectError, LugreSteeringError, VehicleFileError
from lugre_steering.files import (
    is_ours,
    new_folder,
    output_folder,
    read_record,
    replacing,
    temporary_folder,
    write_text,
)
from lugre_steering.resources import config_folder
from lugre_steering.simulate.manoeuvres import from_yaml
from lugre_steering.vehicle import load, save

SHEET = config_folder() / "test_vehicle.yaml"
BAG = Path(__file__).parents[1] / "bags" / "synthetic_double_cycle"
DRIVE = "segments: [{hold: {duration_s: 1.0}}, {sweep: {to_deg: 1.0, rate_deg_s: 2.0}}, {hold: {duration_s: 1.0}}]\n"


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def command(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    return done.exit_code, done.stderr


# --------------------------------------------------------- whole or not at all


def test_what_fails_while_it_is_written_changes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    write_text("old", file)
    with suppress(KeyboardInterrupt), replacing(file) as stream:
        stream.write(b"half")
        raise KeyboardInterrupt
    assert file.read_text() == "old"
    assert names(tmp_path) == {"a.txt"}


@pytest.mark.parametrize("room", [0, 1000, 30_000])
@pytest.mark.parametrize(
    "arguments",
    [
        ("replay", BAG, "--vehicle", SHEET, "--out", "{out}"),
        ("simulate", "double-cycle", "--out", "{out}"),
        ("simulate", "double-cycle", "--storage", "sqlite3", "--out", "{out}"),
        ("import", "{table}", "--map", "{map}", "--out", "{out}/bag"),
        ("import", "{table}", "--map", "{map}", "--storage", "sqlite3", "--out", "{out}/bag"),
    ],
)
def test_where_there_is_no_room_the_result_that_was_wanted_is_named_and_nothing_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[object, ...], room: int
) -> None:
    """A limit of the size of files, in bytes, is a disk that is full for this process; a picture would be refused before the recording."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    places = {"out": tmp_path / "new" / "out", "table": tmp_path / "log.csv", "map": tmp_path / "map.yaml"}
    places["table"].write_text("t,a\n" + "".join(f"{0.01 * i:.2f},{1e-4 * i}\n" for i in range(2000)))
    channels = "channels: {angle/left: {column: a, unit: rad}}"
    places["map"].write_text(f"schema: lugre_steering/import/1\ntime: {{column: t, unit: s}}\n{channels}\n")
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, unlimited[1]))
        code, said = command(*(str(argument).format(**places) for argument in arguments))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
    last = said.splitlines()[-1]
    assert code == 2
    assert f"{places['out']}" in last
    assert "cannot be written" in last
    assert not re.search(r"/\.", last.replace(str(tmp_path), ""))
    assert not places["out"].exists() or names(places["out"]) == set()


def test_links_are_replaced_and_never_followed(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("mine")
    (tmp_path / "out").mkdir()
    link = tmp_path / "out" / "result.json"
    link.symlink_to(precious)
    write_text("new", link)
    assert precious.read_text() == "mine"
    assert (link.is_symlink(), link.read_text()) == (False, "new")


def test_no_beginning_of_a_saved_vehicle_is_a_vehicle(tmp_path: Path) -> None:
    """A power cut may leave any."""
    whole, cut = tmp_path / "whole.yaml", tmp_path / "cut.yaml"
    save(load(SHEET), whole)
    content = whole.read_bytes()
    assert is_ours(whole)
    line_ends = [i for i, byte in enumerate(content) if byte == ord("\n")]  # where most of what is left would be valid
    # The last character is the end of the last line.
    for length in sorted({*line_ends[:-1], *range(0, len(content) - 1, 23), *range(len(content) - 6, len(content) - 1)}):
        cut.write_bytes(content[:length])
        with pytest.raises(VehicleFileError):
            load(cut)
    assert load(whole) == load(SHEET)


def test_a_vehicle_saved_before_the_mark_was_written_still_loads(tmp_path: Path) -> None:
    save(load(SHEET), tmp_path / "new.yaml")
    _, *lines, _ = (tmp_path / "new.yaml").read_text().splitlines()
    (tmp_path / "old.yaml").write_text("\n".join(lines))
    assert load(tmp_path / "old.yaml") == load(SHEET)


def test_a_folder_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    with suppress(KeyboardInterrupt), new_folder(tmp_path / "bag") as filling:
        filling.mkdir()
        (filling / "half").write_text("half")
        raise KeyboardInterrupt
    assert names(tmp_path) == set()
    for replace in (False, True):
        with new_folder(tmp_path / "bag", replace=replace) as filling:
            filling.mkdir()
            (filling / f"whole {replace}").write_text("whole")
    assert names(tmp_path / "bag") == {"whole True"}
    with pytest.raises(FileExistsError), new_folder(tmp_path / "bag") as filling:
        filling.mkdir()
    assert names(tmp_path) == {"bag"}
    assert names(tmp_path / "bag") == {"whole True"}


KILLED = """
import sys, time
from pathlib import Path
from lugre_steering.files import output_folder, replacing, new_folder
out = Path(sys.argv[1])
with output_folder(out), replacing(out / "a.json") as stream, new_folder(out / "bag") as filling:
    stream.write(b"half")
    filling.mkdir()
    (filling / "half").write_text("half")
    print("busy", flush=True)
    time.sleep(60)
"""


def test_a_run_excludes_others_while_it_lives_and_leaves_nothing_when_killed(tmp_path: Path) -> None:
    out = tmp_path / "out"
    busy = subprocess.Popen([sys.executable, "-c", KILLED, str(out)], stdout=subprocess.PIPE, text=True)
    try:
        assert busy.stdout is not None
        assert busy.stdout.readline() == "busy\n"
        with pytest.raises(DataError, match=f"{out}: process {busy.pid} is writing its results there"), output_folder(out):
            pass
        exit_code, said = command("vehicle", SHEET, "--out", out)
        assert exit_code == 2
        assert f"process {busy.pid}" in said
        assert len(names(out)) == 3
    finally:
        busy.send_signal(signal.SIGKILL)
        busy.wait()
    assert len(names(out)) == 3
    with output_folder(out):
        pass
    assert names(out) == set()


def test_what_a_living_run_writes_is_not_taken_for_a_dead_ones(tmp_path: Path) -> None:
    with replacing(tmp_path / "a.txt") as stream, temporary_folder(tmp_path) as folder:
        stream.write(b"slow")
        with output_folder(tmp_path):
            assert folder.is_dir()
    assert (tmp_path / "a.txt").read_text() == "slow"


def test_a_folder_made_for_a_run_that_fails_goes_again(tmp_path: Path) -> None:
    with pytest.raises(DataError), output_folder(tmp_path / "out"):
        raise DataError
    assert names(tmp_path) == set()


@pytest.mark.parametrize("plant", ["symlink", "hard link", "pipe"])
def test_a_lock_that_somebody_laid_out_is_not_written(tmp_path: Path, plant: str) -> None:
    precious, lock = tmp_path / "precious", tmp_path / "out" / ".lugre_steering.lock"
    precious.write_text("mine")
    lock.parent.mkdir()
    if plant == "symlink":
        lock.symlink_to(precious)
    elif plant == "hard link":
        lock.hardlink_to(precious)
    else:
        os.mkfifo(lock)
    with pytest.raises(DataError), output_folder(lock.parent):
        pass
    assert precious.read_text() == "mine"


# ------------------------------------------------------------- whose it is


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("vehicle", SHEET), "footprint.png"),
        (("effects", "slope_bias"), "slope_bias.png"),
        (("simulate", "drive.yaml", "--vehicle", SHEET), "synthetic_drive.png"),
    ],
)
def test_a_picture_of_others_stays_and_ours_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[object, ...], name: str
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    Path("drive.yaml").write_text(DRIVE)
    out = tmp_path / "out"
    out.mkdir()
    theirs = b"\x89PNG\r\n\x1a\n of somebody else"
    (out / name).write_bytes(theirs)
    exit_code, said = command(*arguments, "--out", out)
    assert exit_code == 2
    assert f"{out / name}: exists and is not part of an earlier result" in said
    assert names(out) == {name}
    assert (out / name).read_bytes() == theirs
    (out / name).unlink()
    assert command(*arguments, "--out", out) == (0, "")
    assert is_ours(out / name)
    if arguments[0] == "vehicle":  # bags are never replaced
        assert command(*arguments, "--out", out) == (0, "")


# ------------------------------------------------------------- hostile text


def laughs(levels: int) -> str:
    rows = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    rows += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, levels)]
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (laughs(9), "more than 100000 values"),
        ("a: &a {b: *a}", "stands for what it stands in"),
        ("&a [*a]", "stands for what it stands in"),
        ("[" * 30_000, "more than 50 levels"),
        ("{a: " * 30_000, "more than 50 levels"),
        ("- " * 30_000, "more than 50 levels"),
        ("a: 1\nb: 2\na: 3", "stands twice"),
        ("a: !!int ''", "tag"),
        ("a: !!python/object/apply:os.system [ls]", "tag"),
        ("? [a, b]\n: 1", "no plain text"),
        ("# " + "x" * 600_000, "more than 500000"),
    ],
    ids=lambda value: value[:12],
)
def test_yaml_that_would_take_the_program_down_is_refused(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "hostile.yaml"
    file.write_text(text)
    for read in (load, from_yaml):
        with pytest.raises(LugreSteeringError, match=rf"hostile\.yaml: is not valid YAML: .*{said}"):
            read(file)


def test_a_pipe_or_device_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    for file in (tmp_path / "pipe.yaml", Path("/dev/zero")):
        with pytest.raises(VehicleFileError, match="no regular file"):
            load(file)
        with pytest.raises(EffectError, match="no regular file"):
            read_effects(file)
        assert read_record(file, "lugre_steering/summary/1") is None
    for table in ("/dev/zero", tmp_path / "pipe.yaml"):
        sheet = tmp_path / "sheet.yaml"
        sheet.write_text(SHEET.read_text().replace("rubber_dma_10hz.csv", str(table)))
        with pytest.raises(VehicleFileError, match=r"rubber\.dma_csv.*no regular file"):
            load(sheet)


def test_aliases_that_are_harmless_stay(tmp_path: Path) -> None:
    text = SHEET.read_text().replace("rubber_dma", f"{SHEET.parent}/rubber_dma")
    text = text.replace("rubber_temperature_degC: 15.0", "rubber_temperature_degC: &same 15.0")
    (tmp_path / "alias.yaml").write_text(text.replace("air_temperature_degC: 15.0", "air_temperature_degC: *same"))
    assert load(tmp_path / "alias.yaml") == load(SHEET)
