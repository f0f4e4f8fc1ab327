"""Runs export and conversion as processes beside Blender, and tells how far they are. Knows nothing of Blender's UI."""

from __future__ import annotations

import os
import queue
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

# buzz-convert --progress plain: "frame 12: inferred from 8, 3.1 % of pixels traced; 5/24, 87 % of rays saved, ..."
_FRAME = re.compile(r"; (\d+)/(\d+),")

# What stands before the warnings and the error of buzz-convert.
_PROGRAM = "buzz-convert: "


@dataclass
class Task:
    """Commands run one after the other; `poll` brings their lines and progress, `cancel` ends them."""

    steps: Sequence[tuple[str, Sequence[str]]]
    factor: float = 0.0
    text: str = ""
    warnings: list[str] = field(default_factory=list)
    error: str | None = None
    done: bool = False

    def __post_init__(self) -> None:
        self._next = 0
        self._process: subprocess.Popen | None = None
        self._lines: queue.Queue[str] = queue.Queue()
        self._reader: threading.Thread | None = None

    def poll(self) -> bool:
        """Take in what has come; True while there is something to wait for."""
        if self.done:
            return False
        if self._process is None:
            self._start()
            return not self.done
        while not self._lines.empty():
            self._line(self._lines.get())
        if self._process.poll() is None:
            return True
        if self._reader is not None:
            self._reader.join(timeout=5)
        while not self._lines.empty():
            self._line(self._lines.get())
        code = self._process.returncode
        self._process = None
        if code != 0:
            self.error = self.error or f"{self.steps[self._next - 1][0]} ended with exit code {code}"
            self.done = True
        elif self._next == len(self.steps):
            self.factor, self.done = 1.0, True
        return not self.done

    def wait(self, report: Callable[[str], None] = lambda _text: None) -> None:
        """Run to the end, for background mode."""
        last = ""
        while self.poll():
            if self.text != last:
                report(self.text)
                last = self.text
            if self._process is not None:
                try:
                    self._process.wait(timeout=0.1)
                except subprocess.TimeoutExpired:
                    continue

    def cancel(self) -> None:
        """End the running command; finished frames stay whole."""
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self.error, self.done = "cancelled", True

    def _start(self) -> None:
        label, command = self.steps[self._next]
        self._next += 1
        self.text, self.factor = label, 0.0
        try:
            self._process = subprocess.Popen(
                list(command), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True, encoding="utf-8", errors="replace"
            )
        except OSError as error:
            self.error, self.done = f"{command[0]}: cannot be started ({error.strerror})", True
            return
        self._reader = threading.Thread(target=self._read, args=(self._process,), daemon=True)
        self._reader.start()

    def _read(self, process: subprocess.Popen) -> None:
        assert process.stdout is not None
        for line in process.stdout:
            self._lines.put(line.rstrip())

    def _line(self, line: str) -> None:
        match = _FRAME.search(line)
        if match:
            self.factor = int(match[1]) / max(int(match[2]), 1)
            self.text = line
        elif line.startswith(("export:", "frame ")):
            self.text = line
        elif line.startswith((_PROGRAM + "warning:", "warning:")):
            self.warnings.append(line.removeprefix(_PROGRAM).removeprefix("warning:").strip())
        elif line.startswith((_PROGRAM, "error:")):
            self.error = line.removeprefix(_PROGRAM).removeprefix("error:").strip()


def export_command(blender: str, blend: Path, output: Path, options: Sequence[str], trusted: bool = False) -> list[str]:
    """The command that exports a file in a Blender of its own (or, with the bpy package, in a Python).

    The drivers and scripts of a file that is `trusted` are run.
    """
    script = str(Path(__file__).resolve().parent / "export.py")
    if blender:
        start = [blender, "--background", "--factory-startup", *(["--enable-autoexec"] if trusted else []), str(blend)]
        return [*start, "--python-exit-code", "1", "--python", script, "--", str(output), *options]
    return [sys.executable, script, str(blend), str(output), *options, *(["--scripts"] if trusted else [])]


def find_converter(preferred: str) -> str | None:
    """buzz-convert: where the preferences say, the variable BUZZ_CONVERT, or the search path."""
    for candidate in (preferred, os.environ.get("BUZZ_CONVERT", "")):
        if candidate and Path(candidate).is_file():
            return candidate
    return shutil.which("buzz-convert")


def open_folder(folder: Path) -> None:
    """Show a folder in the system's file browser."""
    if sys.platform == "win32":
        os.startfile(folder)
    else:
        subprocess.Popen(["open" if sys.platform == "darwin" else "xdg-open", str(folder)], stderr=subprocess.DEVNULL)
