# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""``lugre_steering.replay``: recordings through the estimator from a program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from lugre_steering.bag.given import Given, each, files, with_both_tracks
from lugre_steering.bag.reader import bag_name, must_exist
from lugre_steering.effects.registry import made
from lugre_steering.estimator import Options
from lugre_steering.online import Comparison
from lugre_steering.recording import Recording, unused_name
from lugre_steering.replay.passage import Passage
from lugre_steering.replay.result import Replay, ReplayedBag
from lugre_steering.vehicle import Vehicle, vehicle_of


def replay(
    data: Given | Sequence[Given], vehicle: Vehicle | str | Path, *, options: Options | None = None, look_ahead: bool = False
) -> Replay:
    """Torques of bags (paths) or recordings, kept in memory: the same numbers as the command and the live node give.

    ``data``: one or several paths of rosbag2 folders or files, or recordings; ``vehicle``: a vehicle or the path of its file;
    ``look_ahead``: tell the error with the motion known from all samples, too.
    """
    model, timing, items = vehicle_of(vehicle), options or Options(), each(data)
    overall, bags = Comparison(), list[ReplayedBag]()
    for item in items:
        path = Path(item.name if isinstance(item, Recording) else item)
        name = item.name if isinstance(item, Recording) else bag_name(path)
        passage = Passage(path, unused_name(name, [bag.name for bag in bags]), model, timing, look_ahead=look_ahead)
        if isinstance(item, Recording):
            bags.append(passage.remember_recording(with_both_tracks(item, model.channels)))
        else:
            must_exist(path)
            bags.append(passage.remember())
        overall.merge(passage.fit)
    sheet = None if isinstance(vehicle, Vehicle) else Path(vehicle)
    origin = made("replay", {**asdict(timing), "initial_temperature": None, "look_ahead": look_ahead}, sheet, files(items))
    result = Replay.begun(model, None if isinstance(vehicle, Vehicle) else vehicle, timing, origin, ())
    return replace(result, bags=tuple(bags), overall=overall.result())
