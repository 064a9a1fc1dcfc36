"""Documents point at what is there: files, the names in them, and each other."""

import re
from pathlib import Path

import pytest
from test_structure import ROOMS

PACKAGE = Path(__file__).parents[2]
PAPER_TO_CODE = PACKAGE / "docs" / "paper_to_code.md"
DOCUMENTS = [PACKAGE / "README.md", *sorted((PACKAGE / "docs").glob("*.md"))]


def rows(text):
    """Rows of all tables of a document, as dictionaries by heading."""
    headings = None
    for line in text.splitlines():
        if not line.startswith("|"):
            headings = None
            continue
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if headings is None:
            headings = cells
        elif not re.fullmatch(r"[-| :]+", line):
            yield dict(zip(headings, cells))


def quoted(cell):
    return re.findall(r"`([^`]+)`", cell)


def missing(row):
    """What a row's file lacks: itself, or names."""
    (path,) = quoted(row["file"])
    if not (PACKAGE / path).is_file():
        return [f"{path}: no such file"]
    text = (PACKAGE / path).read_text(encoding="utf-8")
    return [
        f"{path}: no {name}" for name in quoted(row["names"]) if not re.search(rf"\b{name}\b", text)
    ]


def test_files_and_names_of_paper_to_code_are_there():
    table = [row for row in rows(PAPER_TO_CODE.read_text(encoding="utf-8")) if "file" in row]
    assert len(table) > 60
    assert [] == [row for row in table if not quoted(row["names"])]
    assert not sum(map(missing, table), []), "\n".join(sum(map(missing, table), []))


def test_what_is_not_there_is_told():
    cells = {"file": "`setup.py`", "names": "`packages`, `rooms`"}
    assert missing(cells) == ["setup.py: no rooms"]
    assert missing({**cells, "file": "`setup.cpp`"}) == ["setup.cpp: no such file"]


def anchors(document):
    """GitHub's, of all headings."""
    text = document.read_text(encoding="utf-8")
    for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(document):
    text = document.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)]+)\)", text):
        path, _, anchor = target.partition("#")
        file = document.parent / path if path else document
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


@pytest.mark.parametrize("name", ["paper_to_code.md", "glossary.md"])
def test_the_readme_leads_to_it_at_its_top(name):
    top = (PACKAGE / "README.md").read_text(encoding="utf-8").split("\n## ")[0]
    assert f"docs/{name}" in top


def test_the_readme_tells_what_every_room_is_for_in_their_order():
    readme = (PACKAGE / "README.md").read_text(encoding="utf-8")
    folders = [row["folder"].strip("`/") for row in rows(readme) if "folder" in row]
    libraries = {f"src/{path.name}" for path in (PACKAGE / "src").iterdir() if path.is_dir()}
    assert libraries <= set(folders)
    package = "src/rbpf_svgp_slam/"
    rooms = [folder[len(package) :] for folder in folders if folder.startswith(package)]
    assert rooms == [room for room in ROOMS if room]
