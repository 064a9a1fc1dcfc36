"""package.xml names what the package imports and starts, so that rosdep installs it all."""

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

PACKAGE = Path(__file__).parents[2]
#: rosdep's name of what is not a ROS package; a ROS package's is its own.
ROSDEP_KEYS = {
    "PIL": "python3-pil",
    "jinja2": "python3-jinja2",
    "matplotlib": "python3-matplotlib",
    "mpl_toolkits": "python3-matplotlib",
    "numpy": "python3-numpy",
    "osgeo": "python3-gdal",
    "psutil": "python3-psutil",
    "pyproj": "python3-pyproj",
    "rospkg": "python3-rospkg",
    "scipy": "python3-scipy",
    "torch": "python3-pytorch-pip",
    "yaml": "python3-yaml",
}
#: Tried, and done without: tools/requirements.sh installs them.
OPTIONAL = {"cmocean", "evo", "pyxtf"}


@pytest.fixture(scope="module")
def at_run_time():
    """What package.xml names for running the package."""
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    return {tag.text for kind in ("depend", "exec_depend") for tag in package.iter(kind)}


def imported(path):
    """First parts of the names of all modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            names = [node.module]
        yield from (name.split(".")[0] for name in names)


def test_every_import_is_named(at_run_time):
    files = [*(PACKAGE / "src").rglob("*.py"), *(PACKAGE / "scripts").glob("*.py")]
    own = {"rbpf_svgp_slam", *OPTIONAL, *sys.stdlib_module_names}
    missing = {
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in files
        for name in imported(path)
        if name not in own and ROSDEP_KEYS.get(name, name) not in at_run_time
    }
    assert files and not missing, "\n".join(sorted(missing))


def test_every_node_of_another_package_is_named(at_run_time):
    """Those of launch files, and rosrun, which experiment.py calls."""
    started = {
        name
        for path in (PACKAGE / "launch").glob("*.launch")
        for name in re.findall(r'pkg="(\w+)"', path.read_text(encoding="utf-8"))
    }
    assert "rviz" in started
    assert started - {"rbpf_svgp_slam"} <= at_run_time
    assert {"rosbash", "roslaunch"} <= at_run_time


def test_optional_packages_have_a_pinned_version():
    text = (PACKAGE / "tools" / "requirements.txt").read_text(encoding="utf-8")
    assert set(re.findall(r"^(\w+)==[\d.]+$", text, re.MULTILINE)) == OPTIONAL
