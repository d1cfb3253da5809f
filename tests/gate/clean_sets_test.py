#!/usr/bin/python3
"""clean_sets_test.py [--all] [SCENE]...

No fault of a rig may be seen where there is none: reports the frames (`glasswing-solver frames`) of each rendered scene of
GLASSWING_DATA as rendered, with noise of several strengths, seeds and bits, less bright, or of a part of the picture (--all: each
scene in every way), and of a session of a simulated rig. Prints what is said of each set, and fails if that is anything.
GLASSWING_BIN: the programs."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

import rig_faults

BIN = pathlib.Path(os.environ["GLASSWING_BIN"])
SCENES = ["dev/A_crystal", "dev/B_bimodal", "dev/C_brushed", "dev/D_foreground", "dev/E_twomonitors", "dev/G_misregistered",
          "dev2/H_threemonitors", "dev2/J_edges"]
SETS = [{"sd": 0, "bits": 16},
        {"sd": 0.003, "seed": 1},
        {"sd": 0.003, "seed": 2, "rows": slice(16, 80)},
        {"sd": 0.01, "seed": 3, "bits": 10},
        {"sd": 0.005, "seed": 4, "faults": [("over", 0.8)]}]


def said_of_archive(archive: pathlib.Path) -> list[str]:
    answer = subprocess.run([BIN / "glasswing-solver", "frames", archive, "--json"], check=True, stdout=subprocess.PIPE)
    report = json.loads(answer.stdout)
    changed = ["something was corrected"] if report["corrected"] and not report["warnings"] else []
    return report["warnings"] + changed


def said_of(scene: pathlib.Path, settings: dict) -> list[str]:
    with tempfile.TemporaryDirectory() as name:
        frames, archive = pathlib.Path(name, "frames"), pathlib.Path(name, "archive")
        rig_faults.degrade(scene, frames, settings.get("faults", []),
                           **{key: value for key, value in settings.items() if key != "faults"})
        subprocess.run([BIN / "glasswing", "import", frames, "--archive", archive], check=True, stdout=subprocess.DEVNULL)
        return said_of_archive(archive)


def main() -> int:
    data = pathlib.Path(os.environ.get("GLASSWING_DATA", "/nonexistent"))
    if not (data / "rendered").exists():
        print(f"skipped: {data}/rendered does not exist")
        return 77
    scenes, every = [name for name in sys.argv[1:] if name != "--all"], "--all" in sys.argv
    said = {}

    def hear(name: str, of_set: list[str]) -> None:
        said[name] = of_set
        print(f"{name}: {len(of_set)} warnings", *of_set, sep="\n    ", flush=True)

    if not scenes:
        hear("rig_crystal", said_of_archive(data / "rig_crystal"))
    for i, scene in enumerate(scenes or SCENES):
        for settings in SETS if every else [SETS[i % len(SETS)]]:
            hear(f"{scene} {settings}", said_of(data / "rendered" / scene, settings))
    count, wrong = len(said), sum(bool(of_set) for of_set in said.values())
    print(f"{wrong} of {count} clean sets draw a warning")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
