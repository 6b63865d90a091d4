# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Read and write rosbag2 recordings (MCAP and sqlite3) as columns, without ROS."""

from lugre_steering.bag.load import read_recording, read_recordings
from lugre_steering.bag.messages import Connection, Messages
from lugre_steering.bag.reader import Bag, Block
from lugre_steering.bag.writer import BagWriter, Part

__all__ = ["Bag", "BagWriter", "Block", "Connection", "Messages", "Part", "read_recording", "read_recordings"]
