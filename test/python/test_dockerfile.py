"""The Dockerfile, which no test builds, names what is there."""

import re
import shlex
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2]
DOCKERFILE = PACKAGE / "Dockerfile"
INSTALLING = PACKAGE / "docs" / "installing.md"


@pytest.fixture(scope="module")
def instructions():
    """By name, each with its arguments, of which there is one of each."""
    text = DOCKERFILE.read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return dict(line.split(maxsplit=1) for line in lines)


def test_its_debian_is_that_of_the_packages(instructions):
    assert instructions["FROM"] == "debian:12"
    assert "Debian 12 " in (PACKAGE / "tools" / "packages.txt").read_text().splitlines()[0]


def test_it_builds_with_the_scripts_of_the_package(instructions):
    scripts = re.findall(r"\btools/\S+", instructions["RUN"])
    assert scripts == ["tools/setup.sh"]
    assert all((PACKAGE / script).stat().st_mode & 0o100 for script in scripts)


def test_the_entry_point_sources_what_the_setup_builds(instructions):
    # Absolute: a container may be started in any folder.
    setup = re.search(r"\. (\S+)", instructions["ENTRYPOINT"]).group(1)
    built = setup.replace(f"{instructions['WORKDIR']}/", "$ROOT/")
    assert f'"{built}"' in (PACKAGE / "tools" / "env.sh").read_text()


def test_what_is_built_here_stays_out_of_it():
    ignored = (PACKAGE / ".dockerignore").read_text().split()
    assert {"build", "out"} <= set(ignored)


def test_what_the_document_runs_in_it_is_there():
    commands = re.findall(r"^docker run .*$", INSTALLING.read_text(), re.MULTILINE)
    assert commands
    for command in commands:
        words = shlex.split(command)
        program = words[words.index("rbpf_svgp_slam") + 1]
        if program == "rosrun":
            program = f"scripts/{words[-2]}"
        assert (PACKAGE / program).is_file(), command
