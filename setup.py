"""Packaging for pip and for colcon (ament_python).

``data_files`` make any install prefix an ament prefix: ``ros2 run helmet_sim_ros simulation_node``
works from a colcon workspace, and from a virtual environment on ``AMENT_PREFIX_PATH``.
"""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import Distribution, find_packages, setup

NAME = "helmet_sim_ros"
HERE = Path(__file__).resolve().parent  # colcon --symlink-install links this file
MANIFEST = ElementTree.parse(HERE / "package.xml").getroot()

#: Where the pinned middleware wheels exist.
WHEELS = "sys_platform == 'linux' and platform_machine == 'x86_64' and python_version < '3.15'"

#: Sweeps and optimisation.
STUDY = [
    "distributed>=2024.1",
    "matplotlib",
    "optuna>=5",
    "pyarrow>=15",
    "scipy>=1.15",
]

#: Reports, figures, replays and exports of logs.
REPORT = [
    "imageio-ffmpeg>=0.5",
    "jinja2",
    "markupsafe",
    "matplotlib",
    "pandas>=2",
    "pillow",
    "pyarrow>=15",
]

#: Helmets from meshes, and the crash behind their crush.
CAD = [
    "embreex>=2.17",
    "emcee>=3.1",
    "fast-simplification>=0.1.7",
    "trimesh>=4.4",
]

#: The explorer in the browser.
EXPLORE = [
    "markupsafe",
    "viser>=1.1",
]

#: The documentation site, `make docs`.
DOCS = [
    "mkdocs-click>=0.8",
    "mkdocs-material>=9.5,<10",
    "mkdocstrings[python]>=0.27",
]

EXTRAS = {
    # ROS 2 Jazzy from wheels. Left out beside a system ROS, so that nothing of it is shadowed.
    "ros": [
        f"ros-rclpy[fastrtps]==7.1.6; {WHEELS}",
        f"ros-jazzy-common-interfaces==5.3.6; {WHEELS}",
    ],
    "cad": CAD,
    "docs": DOCS,
    "explore": EXPLORE,
    "report": REPORT,
    "study": STUDY,
    "test": [
        *CAD,
        *DOCS,
        *EXPLORE,
        *REPORT,
        *STUDY,
        "colcon-common-extensions",
        "dynars>=1.1",
        "hypothesis",
        "jsonschema",
        "mcap-ros2-support",
        "mypy",
        "pytest>=8",
        "pytest-timeout",
        "pytest-xdist",
        "ruff",
        "selenium>=4.10",
        "types-PyYAML",
        "wheel",
    ],
}


def text_of(tag: str) -> str:
    """The text of an element of package.xml, the one place that states it."""
    return (MANIFEST.findtext(tag) or "").strip()


def files_below(folder: str) -> list[tuple[str, list[str]]]:
    """``data_files`` entries that install ``folder`` into the package's share directory."""
    found: dict[str, list[str]] = {}
    for path in sorted(Path(folder).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            found.setdefault(f"share/{NAME}/{path.parent.as_posix()}", []).append(path.as_posix())
    return list(found.items())


class DistributionWithData(Distribution):
    """Editable installs get their ``data_files``: setuptools asks for them by this name."""

    def has_data(self) -> bool:
        return bool(self.has_data_files())


setup(
    distclass=DistributionWithData,
    name=NAME,
    version=text_of("version"),
    description=text_of("description"),
    long_description=(HERE / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license=text_of("license"),
    maintainer=text_of("maintainer"),
    maintainer_email=MANIFEST.find("maintainer").get("email"),
    python_requires=">=3.11",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={"": ["*.pyi"], NAME: ["py.typed", "report/assets/*"]},
    zip_safe=False,
    install_requires=[
        "annotated-types",
        "click>=8.1",
        "llvmlite",
        "lz4",
        "mcap>=1.5",
        "mujoco>=4,<5",
        "numba>=0.62",
        "numpy>=1.26",
        "pydantic>=2.5",
        "pyyaml>=6",
        "rich>=13",
        "rosbags>=0.10",
        "scipy>=1.11",
        "zstandard",
    ],
    extras_require=EXTRAS,
    entry_points={"console_scripts": ["helmet-sim = helmet_sim_ros.cli:main"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"lib/{NAME}", [path.as_posix() for path in sorted(Path("scripts").glob("*_node"))]),
        *files_below("config"),
        *files_below("launch"),
    ],
)
