"""Runs `glasswing fsck` on a daemon's data."""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import subprocess

from daemon import BIN


@dataclasses.dataclass(frozen=True)
class Findings:
    """The number of files looked at, what is damaged, and what interrupted writes left over."""

    files: int
    damage: list[str]
    left_over: list[str]


def fsck(directory: pathlib.Path) -> Findings:
    """Checks the directory, which no daemon uses. AssertionError: it could not be checked."""
    return _findings(str(directory))


def fsck_rig(server: str) -> Findings:
    """Compares catalogue, archives and mattes of the running rig. AssertionError: not all could be asked."""
    return _findings("--rig", "--server", server)


def _findings(*arguments: str) -> Findings:
    environment = dict(os.environ, GLASSWING_CONFIG="/dev/null")
    command = [str(BIN / "glasswing"), "--json", "fsck", *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600.0)
    assert done.returncode in (0, 3), f"fsck {arguments[0]}: {done.stderr}"
    report = json.loads(done.stdout)
    found = [(finding["damage"], f"{finding['file']}: {finding['what']}") for finding in report["findings"]]
    return Findings(report["files"], [what for damage, what in found if damage], [what for damage, what in found if not damage])
