"""A profile hook that logs which functions are called while a test file runs (see `reach`).

`AATRI_REACH_LOG` names the log, `AATRI_REACH_TEST` the test file under way; processes that a test starts inherit both.
"""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

LOG, TEST = "AATRI_REACH_LOG", "AATRI_REACH_TEST"
ROOT = Path(__file__).resolve().parents[2]
TOPS = tuple(f"{ROOT}/{top}/" for top in ("aatri", "stages"))

_seen: dict[int, CodeType] = {}
"""By identity, since to hash a code object takes long; it stays alive here."""


def begin() -> None:
    """Note from now on, in this process and its threads, which functions are called."""
    if LOG in os.environ and TEST in os.environ:
        threading.setprofile(_note)
        sys.setprofile(_note)


def _note(frame: FrameType, event: str, _: Any) -> None:
    code = frame.f_code
    if event != "call" or id(code) in _seen:
        return
    _seen[id(code)] = code
    name = code.co_filename
    if name.startswith(TOPS) and (test := os.environ.get(TEST)):
        line = f"{test}\t{name.removeprefix(f'{ROOT}/')}\t{code.co_qualname}\n"
        log = os.open(os.environ[LOG], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(log, line.encode())  # at once, since a process may be killed
        os.close(log)


def begin_of(path: Path) -> None:
    """What follows belongs to this test file."""
    test = path.relative_to(ROOT).as_posix()
    if os.environ.get(TEST) != test:
        os.environ[TEST] = test
        _seen.clear()
    begin()  # again, should a test have taken the hook away
