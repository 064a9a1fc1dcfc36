"""Reading npz files that may be damaged."""

import zipfile
import zlib

#: What numpy and zipfile raise at bytes that are no npz file or a damaged one.
READING_ERRORS = (
    AttributeError,
    EOFError,
    KeyError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    zipfile.BadZipFile,
    zlib.error,
)
