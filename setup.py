# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""ament_python package for ROS 2 and, at the same time, a plain pip package (no ROS needed for offline work)."""

from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = "lugre_steering"
VERSION = "0.1.0"
DOCS = ["mkdocs>=1.6,<2", "mkdocs-material>=9.5"]

setup(
    name=PACKAGE,
    version=VERSION,
    description="Steering-torque estimator for rubber-tracked vehicles that finds the physics its model leaves out",
    long_description=Path("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    author="The lugre_steering contributors",
    maintainer="The lugre_steering contributors",
    maintainer_email="lugre-steering@example.org",
    license="Apache-2.0",
    # config/ is installed inside the package too, so that pavements are found by name after a plain pip install.
    packages=[*find_packages(include=[PACKAGE, f"{PACKAGE}.*"]), f"{PACKAGE}.config"],
    package_dir={f"{PACKAGE}.config": "config"},
    package_data={
        PACKAGE: ["py.typed", "report/static/*"],
        f"{PACKAGE}.config": ["*", "own_physics/*", "own_physics/example_package/*", "layouts/*"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", sorted(path for path in glob("config/*") if Path(path).is_file())),
        (f"share/{PACKAGE}/config/own_physics", sorted(path for path in glob("config/own_physics/*") if Path(path).is_file())),
        (f"share/{PACKAGE}/config/layouts", sorted(glob("config/layouts/*"))),
        (f"lib/{PACKAGE}", ["scripts/estimator"]),
        (f"share/{PACKAGE}/launch", sorted(glob("launch/*.launch.py"))),
    ],
    zip_safe=False,
    python_requires=">=3.10",
    install_requires=[
        "numpy>=1.26",
        "scipy>=1.11",
        "numba>=0.58",
        "pyyaml>=6.0",
        "rosbags>=0.10",
        "lz4>=4.0",
        "typer>=0.9",
        "rich>=13.0",
        "threadpoolctl>=3.1",
    ],
    extras_require={
        "ros": ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces"],
        "import": ["pyarrow>=14.0", "h5py>=3.8"],
        "frame": ["pandas>=2.0"],
        "fleet": ["pyarrow>=14.0", "distributed>=2023.9"],
        "report": ["matplotlib>=3.6"],
        "docs": DOCS,
        "peers": ["scikit-learn>=1.3", "pysindy>=2.0", "gplearn>=0.4.2"],
        "test": [
            *DOCS,
            "pandas>=2.0",
            "coverage>=7.10",
            "pytest>=7.4",
            "pytest-rerunfailures>=15.0",
            "pytest-xdist>=3.7",
            "hypothesis>=6.80",
            "jsonschema>=4.17",
            "mcap>=1.1",
            "pyarrow>=14.0",
            "distributed>=2023.9",
            "ruff>=0.6",
            "mypy>=1.10",
            "types-PyYAML",
            "setuptools>=61",
            "wheel",
            "colcon-common-extensions",
        ],
    },
    entry_points={
        "console_scripts": [
            "lugre-steering = lugre_steering.cli:main",
        ],
    },
)
