"""A matte with footprints of any shape, from an archive by brute force: what explains it, and what reads it in Python."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile
import types
import unittest

import numpy as np
import ring_archive

import glasswing

BIN = pathlib.Path(os.environ["GLASSWING_BIN"])
ROOT = pathlib.Path(__file__).resolve().parents[3]
NOISE = 0.005


class HeldTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.seen = ring_archive.rings(8, 2)
        ring_archive.write_archive(cls.folder / "ring", cls.seen, NOISE)
        cls.run_program("glasswing-solver", "solve", cls.folder / "ring", cls.folder / "ring.exr", "--set", "footprints=any")
        cls.matte = glasswing.Matte.read(cls.folder / "ring.exr")

    @classmethod
    def run_program(cls, *words):
        done = subprocess.run([BIN / words[0], *words[1:]], capture_output=True, text=True, timeout=120)
        if done.returncode:
            raise AssertionError(f"{words}: {done.stderr}")
        return done.stdout + done.stderr

    def test_a_footprint_is_an_array_that_sums_to_its_weight(self):
        self.assertTrue(self.matte.any_shape[:, 1:-1].all())
        self.assertFalse(self.matte.any_shape[:, [0, -1]].any())
        for x in range(1, 7):
            footprint = self.matte.footprint(x, 0)
            self.assertEqual(footprint.shape, (ring_archive.HEIGHT, ring_archive.WIDTH, 3))
            # White is known to its noise, and to a thousandth of its light.
            self.assertAlmostEqual(footprint[..., 1].sum(), ring_archive.WEIGHT, delta=4 * NOISE)
            # Inside the ring it is darker than on it; no Gaussian is.
            radius = np.hypot(*(np.indices(footprint.shape[:2]) - np.argwhere(self.seen[0, x] > 0).mean(0)[:, None, None]))
            self.assertLess(footprint[radius < 4].mean(), 0.3 * footprint[abs(radius - 12) < 1.5].mean())
        with self.assertRaisesRegex(glasswing.InvalidInput, "there is no pixel 8, 0; this matte has 8x2"):
            self.matte.footprint(8, 0)
        with self.assertRaisesRegex(glasswing.InvalidInput, "this matte has: back"):
            self.matte.footprint(1, 0, "left")

    def test_composites_matrices_and_footprints_are_one(self):
        picture = np.random.default_rng(2).random((ring_archive.HEIGHT, ring_archive.WIDTH, 3), np.float32)
        exact = self.matte.composite({"back": picture}, exact=True)
        # What the monitor would show through the rings: a footprint is unsure where samples are.
        truth = ring_archive.FOREGROUND + ring_archive.WEIGHT * np.einsum("ijvu,vuc->ijc", self.seen, picture)
        self.assertLess(np.sqrt(np.mean((exact - truth)[:, 1:-1] ** 2)), 10 ** (-38 / 20))
        np.testing.assert_allclose(self.matte.composite({"back": picture}), exact, atol=0.006)
        for x in (1, 4):
            own = (self.matte.footprint(x, 1) * picture).sum((0, 1)) + self.matte.foreground[1, x]
            np.testing.assert_allclose(own, exact[1, x], atol=1e-4)
        transport = self.matte.transport("g")
        light = transport.matrix @ picture[..., 1].ravel() + self.matte.foreground[..., 1].ravel()
        np.testing.assert_allclose(light.reshape(2, 8), exact[..., 1], atol=1e-4)
        errors = self.matte.error({"back": picture})[:, 1:-1]
        known = np.isfinite(errors)
        self.assertGreater(known.mean(), 0.5)
        self.assertLess(np.nanmax(errors), 0.1)

    def test_blenders_add_on_shows_it(self):
        addon = types.ModuleType("glasswing_blender")  # without its panels, which need Blender
        addon.__path__ = [str(ROOT / "compositing/hosts/blender/glasswing_blender")]
        sys.modules["glasswing_blender"] = addon
        from glasswing_blender import compositor, matte

        x, y = np.meshgrid(np.arange(ring_archive.WIDTH), np.arange(ring_archive.HEIGHT))
        picture = np.stack([0.5 + 0.5 * np.sin(0.3 * x + phase) * np.sin(0.2 * y) for phase in range(3)], -1).astype(np.float32)
        exact = self.matte.composite({"back": picture}, exact=True)
        shown = compositor.Compositor(matte.read_matte(self.folder / "ring.exr")).composite([picture])
        self.assertLess(abs(shown - exact)[:, 1:-1].max(), 0.002)

    def test_explain_tells_the_choice_and_draws_it(self):
        picture = self.folder / "footprint.png"
        said = self.run_program("glasswing-solver", "explain", self.folder / "ring", "3", "1", "--set", "footprints=any", "--picture", picture)
        choice = re.search(r"g on monitor back: pyramid: (\d+) coefficients .* with ([\d.]+) % of a light of ([\d.]+); "
                           r"the other ([\d.]+) % stay in \d Gaussians", said)
        self.assertIsNotNone(choice, said)
        count, share, light, rest = (float(each) for each in choice.groups())
        self.assertGreater(count, 4)
        self.assertAlmostEqual(share + rest, 100, delta=0.2)
        self.assertAlmostEqual(light, ring_archive.WEIGHT, delta=4 * NOISE)
        drawn = glasswing.read_picture(picture)
        own = self.matte.footprint(3, 1)
        self.assertLess(abs(drawn - own / own.max()).max(), 0.02)  # 8 bits
        self.assertIn("Gaussians: 1 modes", self.run_program(
            "glasswing-solver", "explain", self.folder / "ring", "0", "1", "--set", "footprints=any"))

    def test_others_say_what_they_lose(self):
        lost = r"warning: 100\.0 % of the object's pixels, with (8|9|10)\d?\.\d % of its light, have footprints of any shape, which {} cannot hold"
        for verb, output, holders in ((["stmap"], "st.exr", "STMaps"), (["nuke"], "ring.nk", "Nuke scripts"),
                                      (["matte", "deliver"], "delivery.exr", "delivery files"),
                                      (["matte", "resize"], "small.exr", "matte edits other than crop, flip and join"),
                                      (["view"], "sheet.png", "sheets")):
            words = [*verb, self.folder / "ring.exr", *(["4x2"] if "resize" in verb else []), "-o", self.folder / output]
            said = self.run_program("glasswing-compositing", *words)
            self.assertRegex(said, lost.format(holders))
            self.assertEqual(said.count("warning: 100"), 1, said)


if __name__ == "__main__":
    unittest.main()
