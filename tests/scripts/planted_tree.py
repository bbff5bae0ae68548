"""Trees of planted files for the tests of the checkers; a module of these tests. Imports find scripts/."""

import contextlib
import os
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../scripts"))


@contextlib.contextmanager
def planted(files):
    """A temporary folder with {path: text}; paths whose text is None are left out."""
    with tempfile.TemporaryDirectory() as root:
        for path, text in files.items():
            if text is not None:
                os.makedirs(os.path.dirname(os.path.join(root, path)) or root, exist_ok=True)
                with open(os.path.join(root, path), "w", encoding="utf-8") as file:
                    file.write(text)
        yield root
