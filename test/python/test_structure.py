"""The house of the Python package: who may import whom, by reading the imports of every file.

Imports in functions and those for type checkers alone count as well: both say what a file knows.
Engines are not among them, which `maps` loads by name (`map/engine`).
"""

import ast
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "src" / "rbpf_svgp_slam"

#: Lowest first: a file imports from its own room and from those before it. The first are the files
#: beside the rooms, of which every room may make use.
ROOMS = [
    "",
    "protocol",
    "parameters",
    "survey_area",
    "maps",
    "svgp",
    "gmrf",
    "run",
    "smoothing",
    "charts",
    "metrics",
    "figures",
    "exports",
    "evaluation",
    "bags",
    "checking",
    "simulation",
    "importers",
    "experiments",
    "recorder",
    "display",
    "map_node",
    "keeper",
]
#: All other rooms can be used, and tested, where there is no ROS.
ROOMS_WITH_ROS = {"bags", "checking", "display", "experiments", "importers", "keeper"}
ROOMS_WITH_ROS |= {"map_node", "parameters", "protocol", "recorder"}
ROS = "genpy rosbag rosgraph roslaunch roslib rosnode rospkg rospy std_srvs tf2_ros".split()
#: A room has one of each; python gives them their names.
EVERY_ROOM_S = {"__init__.py", "__main__.py"}


@dataclass(frozen=True)
class Import:
    file: str  # relative to the package
    line: int
    name: str  # dotted, as it is imported
    target: str | None  # file of the package, if it is one

    def __str__(self):
        return f"{self.file}:{self.line} imports {self.name}"


def room(file):
    return file.split("/")[0] if "/" in file else ""


def files_of(package):
    return sorted(path.relative_to(package).as_posix() for path in package.rglob("*.py"))


def imports_of(package):
    """All imports [Import] of the package's files, each name of `from … import` for itself."""
    files = set(files_of(package))

    def file_of(name):
        parts = name.split(".")
        if parts[0] != package.name:
            return None
        stem = "/".join(parts[1:])
        ends = (f"{stem}.py", f"{stem}/__init__.py" if stem else "__init__.py")
        return next((file for file in ends if file in files), None)

    found = []
    for file in sorted(files):
        for node in ast.walk(ast.parse((package / file).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [(alias.name, None) for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{file}:{node.lineno}: expected the module's full name"
                names = [(node.module, f"{node.module}.{alias.name}") for alias in node.names]
            else:
                continue
            for module, member in names:
                whole = member if member and (file_of(member) or not file_of(module)) else module
                found.append(Import(file, node.lineno, whole, file_of(whole)))
    return found


def a_circle(imports):
    """The imports that lead from a file back to itself; none if there is no such file."""
    of = {}
    for one in imports:
        if one.target not in (None, one.file):
            of.setdefault(one.file, []).append(one)
    done = set()

    def walk(file, path):
        on_path = [one.file for one in path]
        if file in on_path:
            return path[on_path.index(file) :]
        if file in done:
            return []
        for one in of.get(file, []):
            circle = walk(one.target, [*path, one])
            if circle:
                return circle
        done.add(file)
        return []

    return next(filter(None, (walk(file, []) for file in of)), [])


def upward(imports, rooms):
    """Imports from a room above the file's own."""
    return [
        one
        for one in imports
        if one.target is not None and rooms.index(room(one.target)) > rooms.index(room(one.file))
    ]


def is_ros(name):
    parts = name.split(".")
    if parts[0] == PACKAGE.name:  # what is generated from msg/ and srv/
        return parts[1:2] in (["msg"], ["srv"])
    return parts[0] in ROS or parts[0].endswith("_msgs")


def listed(imports):
    return "\n".join(map(str, imports))


@pytest.fixture(scope="module")
def imports():
    return imports_of(PACKAGE)


def test_every_room_has_its_place():
    assert {room(file) for file in files_of(PACKAGE)} == set(ROOMS)


def test_no_file_imports_itself_by_way_of_others(imports):
    circle = a_circle(imports)
    assert not circle, listed(circle)


def test_no_file_imports_from_a_room_above_its_own(imports):
    wrong = upward(imports, ROOMS)
    assert not wrong, listed(wrong)


def test_only_rooms_that_speak_to_ros_import_it(imports):
    wrong = [one for one in imports if is_ros(one.name) and room(one.file) not in ROOMS_WITH_ROS]
    assert not wrong, listed(wrong)
    needless = ROOMS_WITH_ROS - {room(one.file) for one in imports if is_ros(one.name)}
    assert not needless, f"{needless} need no ROS"


def test_no_file_name_occurs_twice():
    names = Counter(file.split("/")[-1] for file in files_of(PACKAGE))
    twice = {name for name, count in names.items() if count > 1 and name not in EVERY_ROOM_S}
    again = [file for file in files_of(PACKAGE) if file.split("/")[-1] in twice]
    assert not again, "\n".join(again)


# What the above would find, in a house of two rooms


@pytest.fixture
def house(tmp_path):
    def build(**rooms):
        package = tmp_path / PACKAGE.name
        for name, text in rooms.items():
            path = package / name / f"{name}.py"
            path.parent.mkdir(parents=True)
            (path.parent / "__init__.py").touch()
            path.write_text(text)
        return imports_of(package)

    return build


def test_a_circle_is_told_with_every_step(house):
    there = f"from {PACKAGE.name}.attic import attic\n"
    back = f"import numpy\ndef later():\n    from {PACKAGE.name}.cellar.cellar import anything\n"
    circle = a_circle(house(cellar=there, attic=back))
    assert sorted(map(str, circle)) == [
        f"attic/attic.py:3 imports {PACKAGE.name}.cellar.cellar",
        f"cellar/cellar.py:1 imports {PACKAGE.name}.attic.attic",
    ]
    assert a_circle(circle[:1]) == []


def test_an_import_from_above_is_told(house):
    imports = house(cellar=f"import {PACKAGE.name}.attic.attic\n", attic="import cellar\n")
    assert listed(upward(imports, ["cellar", "attic"])) == (
        f"cellar/cellar.py:1 imports {PACKAGE.name}.attic.attic"
    )
    assert upward(imports, ["attic", "cellar"]) == []


def test_ros_is_known_under_all_its_names(house):
    text = f"""
import rospy
import rosbag.bag
from sensor_msgs.msg import PointCloud2
from {PACKAGE.name} import srv
from {PACKAGE.name}.msg import MapStatus
import rosy, numpy
"""
    imports = house(attic=text)
    assert [one.line for one in imports if is_ros(one.name)] == [2, 3, 4, 5, 6]
