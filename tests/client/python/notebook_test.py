"""docs/series.ipynb, executed cell by cell on a simulated rig of two monitors, as Jupyter would. The command line gives the
truth of what it made."""

import ast
import contextlib
import json
import os
import unittest

import exr_reader
import numpy as np
import simulated_rig

import glasswing

NOTEBOOK = simulated_rig.ROOT / "docs/series.ipynb"
SERIES_LINES = 15


def srgb(light: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, not rounded to codes."""
    shown = np.clip(np.asarray(light, np.float64), 0.0, 1.0)
    return np.where(shown <= 0.0031308, 12.92 * shown, 1.055 * shown ** (1 / 2.4) - 0.055)


def run_cell(source: str, names: dict[str, object]) -> bytes | str | None:
    """Runs a cell, and returns what Jupyter would show of its last line if that is an expression."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, str(NOTEBOOK), "exec"), names)
    value = None if last is None else eval(compile(ast.Expression(last.value), str(NOTEBOOK), "eval"), names)
    for show in ("_repr_html_", "_repr_png_"):
        if hasattr(value, show):
            return getattr(value, show)()
    return None if value is None else repr(value)


class NotebookTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemons = simulated_rig.SimulatedRig("--monitors", "2", "--devices", "real", "--refresh", "120", "--fps", "400")
        cls.addClassCleanup(cls.daemons.stop)
        (cls.daemons.work / "deploy").symlink_to(simulated_rig.ROOT / "deploy")
        notebook = json.loads(NOTEBOOK.read_text())
        cls.cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
        cls.outputs = [cell["outputs"] for cell in notebook["cells"] if cell["cell_type"] == "code"]
        cls.names: dict[str, object] = {}
        os.environ["GLASSWING_SERVER"] = cls.daemons.server
        cls.shown = {}
        with contextlib.chdir(cls.daemons.work):
            for cell in cls.cells:
                cls.shown[cell.splitlines()[-1]] = run_cell(cell, cls.names)

    def test_the_series_is_short(self):
        [series] = [cell for cell in self.cells if "rig.capture" in cell]
        self.assertLessEqual(len(series.splitlines()), SERIES_LINES)

    def test_the_notebook_holds_no_outputs(self):
        self.assertEqual([each for each in self.outputs if each], [])

    def test_all_captures_are_composited(self):
        for number in (1, 2, 3):
            name = f"vase-{number}"
            matte, made = self.daemons.work / f"{name}.exr", self.daemons.work / f"{name}-cli.exr"
            self.daemons.glasswing("fetch", name, "-o", str(matte))
            pictures = simulated_rig.ROOT / "deploy/pictures"
            self.daemons.glasswing(
                "composite", str(matte), "--background", f"back={pictures}/harbour.png", "--background",
                f"left={pictures}/quilt.png", "-o", str(made), "--error", str(made.with_suffix(".error.exr")),
            )
            planes, picture = exr_reader.read_exr(made)[""], self.names["composites"][name]
            for channel, letter in enumerate("RGB"):
                np.testing.assert_array_equal(picture[:, :, channel], planes[letter])
            # Half a code of sRGB, and the rounding of floats.
            written = glasswing.linear_to_srgb(glasswing.read_picture(self.daemons.work / f"{name}.png"))
            self.assertLessEqual(np.abs(written - 255.0 * srgb(picture)).max(), 0.5 + 255 * 2.0**-20)
        error = self.names["error"]
        [planes] = exr_reader.read_exr(made.with_suffix(".error.exr")).values()
        known = planes["A"] == 1
        self.assertTrue(known.any())
        np.testing.assert_array_equal(np.isfinite(error).all(axis=2), known)
        for channel, letter in enumerate("RGB"):
            np.testing.assert_array_equal(error[:, :, channel][known], planes[letter][known])

    def test_the_rig_is_calibrated(self):
        calibration = self.names["calibration"]
        # The camera does not see the left one, and is told so.
        self.assertEqual([latency.monitor for latency in calibration.latencies], ["back"])
        self.assertTrue(any(note.startswith("not measured: left") for note in calibration.notes), calibration.notes)
        self.assertEqual(calibration.camera.camera, "camera-1")
        self.assertEqual([display.monitor for display in calibration.displays], ["back"])
        listed = json.loads(self.daemons.glasswing("calibrate", "list", "--json"))
        self.assertEqual([camera["camera"] for camera in listed["cameras"]], ["camera-1"])
        self.assertEqual([display["monitor"] for display in listed["displays"]], ["back"])

    def test_cells_show_pictures(self):
        for words in ('composites["vase-1"]', "matte", "error", "frames[-1]"):
            self.assertEqual(self.shown[words][:8], b"\x89PNG\r\n\x1a\n", words)
        self.assertIn("<td>camera-1</td>", self.shown["rig"])
        self.assertIn("<td>vase-3</td>", self.shown["session"])
        self.assertIn("<img ", self.shown["session"])
        self.assertEqual(self.names["samples"].shape, (len(self.names["frames"]), 3))


if __name__ == "__main__":
    unittest.main()
