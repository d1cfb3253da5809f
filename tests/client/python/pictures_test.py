"""Pictures, and conversion between light and sRGB codes."""

import pathlib
import tempfile
import unittest

import numpy as np

import glasswing
from glasswing import pictures


def linear(code: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1."""
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


class PicturesTest(unittest.TestCase):
    def test_light_of_codes_is_the_standards(self):
        codes = np.arange(256, dtype=np.uint8)
        # Float32, through a power of 2.4: a few parts in 2^24 of each value.
        np.testing.assert_allclose(glasswing.srgb_to_linear(codes), linear(codes / 255.0), rtol=2**-20)
        np.testing.assert_array_equal(
            glasswing.srgb_to_linear(codes), glasswing.srgb_to_linear(codes.astype(np.uint16) * 257)
        )

    def test_every_code_comes_back(self):
        codes = np.arange(256, dtype=np.uint8).reshape(4, 64)
        np.testing.assert_array_equal(glasswing.linear_to_srgb(glasswing.srgb_to_linear(codes)), codes)

    def test_light_beyond_the_codes_is_clamped(self):
        np.testing.assert_array_equal(glasswing.linear_to_srgb([-1.0, 2.0]), [0, 255])

    def test_what_is_no_light(self):
        self.assertRaises(glasswing.InvalidInput, glasswing.srgb_to_linear, np.zeros(3, np.int64))
        self.assertRaises(glasswing.InvalidInput, glasswing.write_picture, "x.png", np.zeros((2, 2)))

    def test_a_picture_comes_back(self):
        codes = np.random.default_rng(1).integers(0, 256, (5, 7, 3), np.uint8)
        with tempfile.TemporaryDirectory() as directory:
            path = pathlib.Path(directory, "picture.png")
            glasswing.write_picture(path, glasswing.srgb_to_linear(codes))
            np.testing.assert_array_equal(glasswing.linear_to_srgb(glasswing.read_picture(path)), codes)
            self.assertRaises(glasswing.NotFound, glasswing.read_picture, path.with_name("none.png"))
            self.assertRaises(glasswing.InvalidInput, glasswing.write_picture, path.with_suffix(".gif"), codes / 255.0)

    def test_any_strides_will_do(self):
        picture = np.random.default_rng(2).random((6, 4, 3))
        turned = pictures.resized(picture[::-1, ::2], 2, 6)
        np.testing.assert_array_equal(turned, picture[::-1, ::2].astype(np.float32))

    def test_resizing_keeps_a_plain_colour(self):
        plain = np.full((8, 8, 3), 0.25)
        np.testing.assert_array_equal(pictures.resized(plain, 4, 2), np.full((2, 4, 3), np.float32(0.25)))


if __name__ == "__main__":
    unittest.main()
