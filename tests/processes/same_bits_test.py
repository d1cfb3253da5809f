"""Mattes are the same bit for bit, however they are solved: by one process without a server, by 1, 2 and 8
solvers, and by solvers that read a copy of the archive because the node that captured it is gone."""

from __future__ import annotations

import pathlib
import subprocess
import tempfile

from daemon import BIN, ROOT, free_port
from glasswing.v1 import node_service_pb2
from lab import Lab, capture_archives, glasswing, until

_METHODS = {"gaussian": "gaussian", "boxes": "hierarchical", "video": "ramp"}  # by session
VIDEO = """
method: "ramp"
monitors { name: "back" }
ramp { empty_frames: 4 frames: 24 }
solids { colour: [0, 0, 0] }
square_waves { levels: 5 }
hold_refreshes: 2
exposure_ms: 4
"""


def mattes(file: pathlib.Path) -> dict[str, bytes]:
    """The contents of a matte's file, or of the files in a video's directory, by name."""
    files = [file] if file.exists() else sorted(file.with_suffix("").glob("*.exr"))
    assert files, f"{file} does not exist, nor a directory of that name"
    return {each.name if len(files) > 1 else "": each.read_bytes() for each in files}


def on_the_spot(archive: pathlib.Path, matte: pathlib.Path, method: str) -> dict[str, bytes]:
    """Solves in one process, without a server."""
    target = matte.with_suffix("") if method == "ramp" else matte
    subprocess.run([str(BIN / "glasswing-solver"), "solve", str(archive), str(target), "--method", method], check=True)
    return mattes(matte)


def who_solved(lab: Lab, job: int) -> int:
    """The number of solvers that solved a tile of the job."""
    return sum(f"job={job} tile" in solver.log.read_text() for solver in lab.solvers)


def check(lab: Lab, expected: dict[str, dict[str, bytes]], how: str) -> None:
    """Solves every session and compares its mattes."""
    for name, right in expected.items():
        job = lab.solve(_METHODS[name], name).job
        tiles = lab.wait_until_done(120.0, name).tile_count
        assert mattes(lab.matte(name)) == right, f"{name}: the matte of {how} differs from that of one process (bits.same)"
        print(f"{name:10} {how}: the same bits; {tiles} tiles by {who_solved(lab, job)} of them")


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        work = pathlib.Path(temporary)
        video = work / "video.txtpb"
        video.write_text(VIDEO)
        archives = {name: work / name for name in _METHODS}
        plans = ROOT / "deploy/plans"
        still = {archives["gaussian"]: plans / "quick.txtpb", archives["boxes"]: plans / "hierarchical.txtpb"}
        capture_archives(still, work, "64x56")
        capture_archives({archives["video"]: video}, work, "64x56", "wobble")
        expected = {name: on_the_spot(archives[name], work / f"{name}-here.exr", method) for name, method in _METHODS.items()}

        lab = Lab(work, archives, ("--least-tile", "0.01"))
        try:
            for solvers in (1, 2, 8):
                while len(lab.solvers) < solvers:
                    lab.add_solver().start()
                until(lambda: lab.solvers_up() == solvers, f"{solvers} solvers are up")
                check(lab, expected, f"{solvers} solvers")

            copy = lab.camera_at(free_port(), "copy")
            copy.start()
            try:
                until(lambda: lab.nodes_up(node_service_pb2.NODE_KIND_CAMERA) == 2, "the node of the copy is up")
                for name in _METHODS:
                    glasswing(lab.address, "replicate", name, "copy")
                lab.camera.kill()
                check(lab, expected, "8 solvers, from a copy")
            finally:
                copy.end()
        finally:
            lab.close()


if __name__ == "__main__":
    main()
