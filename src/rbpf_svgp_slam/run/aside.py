"""Files that are written aside and put in place whole: nobody who reads meets half of one.

Neither does who comes after a loss of power.
"""

from __future__ import annotations

import os
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import Iterator, Sequence


@contextmanager
def written_aside(folder: Path, may_lack: Sequence[str] = ()) -> Iterator[Path]:
    """A folder to write into, whose files are put into `folder` at the end; none if that fails.

    may_lack: files that are not always written; one that an earlier run has left does not stay.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".writing_", dir=folder) as name:
        aside = Path(name)
        yield aside
        written = sorted(path.name for path in aside.iterdir())
        for file in written:
            _to_disk(aside / file)
        for file in written:
            os.replace(aside / file, folder / file)
        _to_disk(folder)
        for file in set(may_lack).difference(written):
            (folder / file).unlink(missing_ok=True)


def _to_disk(path: Path) -> None:
    """A file's content, or a folder's names."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
