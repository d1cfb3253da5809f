"""glasswing.conf lists every option of every daemon, and no other: options_in_conf.py CONF BIN"""

import pathlib
import re
import subprocess
import sys

DAEMONS = ("server", "console", "display", "camera", "solver")
OPTION = re.compile(r"(?<![\w-])--[a-z0-9][a-z0-9-]*")
OF_ANY_PROGRAM = {"--help", "--version"}


def listed(conf: str) -> dict[str, set[str]]:
    """By the heading, "every daemon" or a daemon's name, below "All options"."""
    found: dict[str, set[str]] = {}
    for line in conf.partition("# All options")[2].splitlines():
        heading = re.fullmatch(r"# (every daemon|glasswing-\w+):", line)
        if heading:
            options = found.setdefault(heading[1], set())
        elif found:
            options |= set(OPTION.findall(line))
    return found


def known(program: pathlib.Path) -> set[str]:
    """The options that --help begins a line with."""
    words = subprocess.run([program, "--help"], check=True, capture_output=True, text=True).stdout
    return set(re.findall(r"^  (?:-\w,)?(--[a-z0-9-]+)", words, re.MULTILINE)) - OF_ANY_PROGRAM


def main(conf: str, binaries: str) -> None:
    text = pathlib.Path(conf).read_text()
    in_conf = listed(text)
    wrong = []
    for daemon in DAEMONS:
        name = f"glasswing-{daemon}"
        options, there = known(pathlib.Path(binaries, name)), in_conf["every daemon"] | in_conf[name]
        assert len(options) > 5, f"{name} --help is not understood"
        wrong += [f"{name} has {option}, which {conf} does not list" for option in sorted(options - there)]
        wrong += [f"{name} has no {option}, which {conf} lists" for option in sorted(there - options)]
        [given] = re.findall(rf'^GLASSWING_{daemon.upper()}_OPTIONS="(.*)"$', text, re.MULTILINE)
        if "--metrics" not in given:
            wrong.append(f"{conf} starts {name} without --metrics, which the alerts need")
    if wrong:
        sys.exit("\n".join(wrong))


main(*sys.argv[1:])
