# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Logs that are no rosbag2 recordings (CSV, JSON, npz, Parquet, HDF5, MATLAB), turned into bags with the standard topics."""

from lugre_steering.importing.map import ImportMap, load_map
from lugre_steering.importing.read import read_table
from lugre_steering.importing.table import Table
from lugre_steering.importing.write import import_table

__all__ = ["ImportMap", "Table", "import_table", "load_map", "read_table"]
