"""Errors an artist can act on, and the list of what could not be carried."""

from __future__ import annotations

import sys
from typing import TextIO

EXIT_FAILED = 1
EXIT_USAGE = 2
EXIT_INPUT = 3
EXIT_OUTPUT = 4


class ExportError(Exception):
    """Stops the export with one line for the user and an exit code (those of buzz-convert)."""

    code = EXIT_FAILED


class InputError(ExportError):
    """The file to export is missing, damaged or holds nothing that can be exported."""

    code = EXIT_INPUT


class OutputError(ExportError):
    """The result cannot be written where it was asked for."""

    code = EXIT_OUTPUT


class Lost:
    """Collects what cannot be carried: once for each object and feature, in the order met."""

    def __init__(self) -> None:
        self.items: list[dict[str, str]] = []
        self._seen: set[tuple[str, str]] = set()

    def add(self, name: str, feature: str, action: str) -> None:
        """Note that `feature` of the object called `name` is lost, and what its artist can do about it."""
        if (name, feature) not in self._seen:
            self._seen.add((name, feature))
            self.items.append({"object": name, "feature": feature, "action": action})

    def lines(self) -> list[str]:
        """One line for each thing lost."""
        return [f"warning: {i['object']}: {i['feature']}: {i['action']}" for i in self.items]

    def show(self, stream: TextIO | None = None) -> None:
        """Print the lines (standard error by default)."""
        for line in self.lines():
            print(line, file=stream or sys.stderr, flush=True)
