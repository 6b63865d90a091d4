# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings as rosbag2 folders, written by rosbags alone: the estimator's reader and writer have no part in them."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from lugre_steering.proof.sensors import Samples

TYPES = {"angle": "JointState", "pressure": "FluidPressure", "temperature": "Temperature"}
_SENTINEL = 1.2345678e-3
_RECEIVED_NS = 600_000
"""A message is logged so much later than it is stamped."""


class Topic(NamedTuple):
    """One sensor: topic name, kind (of TYPES), joint name (angles only), and what it recorded."""

    name: str
    kind: str
    joint: str
    samples: Samples


def write_bag(path: Path, topics: Sequence[Topic], epoch_s: int, plugin: StoragePlugin) -> None:
    """Write all messages in the order of their stamps."""
    store = get_typestore(Stores.ROS2_JAZZY)
    stamp, header = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Header"]
    none = np.zeros(0)
    head = header(stamp(0, 0), "steering_axle")
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections, templates, places = [], [], []
        for topic in topics:
            kind = f"sensor_msgs/msg/{TYPES[topic.kind]}"
            connections.append(writer.add_connection(topic.name, kind, typestore=store))
            rest = ([topic.joint], np.array([_SENTINEL]), none, none) if topic.kind == "angle" else (_SENTINEL, 0.0)
            raw = bytes(store.serialize_cdr(store.types[kind](head, *rest), kind))
            templates.append(bytearray(raw))
            places.append(raw.index(struct.pack("<d", _SENTINEL)))
        stamps = [epoch_s * 10**9 + np.round(topic.samples.time * 1e9).astype(np.int64) for topic in topics]
        which = np.repeat(np.arange(len(topics)), [ns.size for ns in stamps])
        within = np.concatenate([np.arange(ns.size) for ns in stamps])
        for k in np.argsort(np.concatenate(stamps), kind="stable"):
            source, i = int(which[k]), int(within[k])
            ns, raw_message = int(stamps[source][i]), templates[source]
            struct.pack_into("<iI", raw_message, 4, ns // 10**9, ns % 10**9)
            struct.pack_into("<d", raw_message, places[source], float(topics[source].samples.value[i]))
            writer.write(connections[source], ns + _RECEIVED_NS, bytes(raw_message))
