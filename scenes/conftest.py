"""The scene scripts import each other by plain names; the tests import them likewise."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent / "build"))
