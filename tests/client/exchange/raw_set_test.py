"""Raw photographs end to end: a scene in closed form as a set of 14-bit DNGs, imported, solved and composited, against the
same light as linear 16-bit frames. Both come as close to the truth, and to each other, as their quantisation allows."""

from __future__ import annotations

import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
from exr_reader import read_exr  # noqa: E402

BIN = pathlib.Path(os.environ["GLASSWING_BIN"])
MONITOR = (160, 120)
WIDTH, HEIGHT = 40, 30
BITS, BLACK, WHITE = 14, 512, 15871
CHANNEL = np.array([[0, 1], [1, 2]])[np.arange(HEIGHT)[:, None] % 2, np.arange(WIDTH) % 2]  # RGGB
STRIPE_SIGMA, STRIPE_STEP = 8.0, 8.0
# Far enough from the monitor's edges that no footprint reaches them.
X, Y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
TRUTH = np.stack(
    [
        0.02 + 0.01 * CHANNEL,  # F
        0.7 - 0.1 * CHANNEL + 0.003 * X,  # R
        40.0 + 1.9 * X + 0.2 * Y + 1.5 * CHANNEL,  # c
        30.0 + 1.8 * Y + 0.3 * X - CHANNEL,
        2.0 + 0.05 * X,  # Sigma: xx, xy, yy
        0.3 + 0.0 * X,
        1.5 + 0.05 * Y,
    ]
)
# A cosine in the picture behind, cycles per px along x and y: no stimulus.
WAVE = np.array([1.0 / 36.0, 1.0 / 48.0])


def stripe_light(p: np.ndarray, phi_deg: float, r: float) -> np.ndarray:
    """A Gaussian stripe through a Gaussian footprint is a Gaussian of both variances and that of a flat pixel, 1/12."""
    a, b = np.cos(np.radians(phi_deg)), np.sin(np.radians(phi_deg))
    spread = STRIPE_SIGMA**2 + 1 / 12 + a * a * p[4] + 2 * a * b * p[5] + b * b * p[6]
    return p[0] + p[1] * STRIPE_SIGMA / np.sqrt(spread) * np.exp(-0.5 * (p[2] * a + p[3] * b - r) ** 2 / spread)


def wave_light(p: np.ndarray) -> np.ndarray:
    """The picture behind, 0.5 + 0.4 cos, sampled at the middles of its pixels, each of which is flat."""
    fx, fy = WAVE
    blur = np.exp(-2 * np.pi**2 * (fx * fx * p[4] + 2 * fx * fy * p[5] + fy * fy * p[6])) * np.sinc(fx) * np.sinc(fy)
    return p[0] + p[1] * (0.5 + 0.4 * blur * np.cos(2 * np.pi * (fx * p[2] + fy * p[3])))


def stimuli() -> list[dict[str, object]]:
    """Solids, and stripes in four directions."""
    shown: list[dict[str, object]] = [{"kind": "solid", "colour": [c, c, c]} for c in (0.0, 1.0)]
    for phi in (0.0, 45.0, 90.0, 135.0):
        a, b = np.cos(np.radians(phi)), np.sin(np.radians(phi))
        ends = [a * x + b * y for x in (0, MONITOR[0]) for y in (0, MONITOR[1])]
        for r in np.arange(min(ends), max(ends) + STRIPE_STEP, STRIPE_STEP):
            shown.append({"kind": "gauss_stripe", "phi_deg": phi, "r_px": float(r), "sigma_px": STRIPE_SIGMA, "peak": 1.0})
    return shown


def light_of(p: np.ndarray, stimulus: dict[str, object]) -> np.ndarray:
    if stimulus["kind"] == "solid":
        return p[0] + p[1] * stimulus["colour"][0]
    return stripe_light(p, stimulus["phi_deg"], stimulus["r_px"])


def write_png16(path: pathlib.Path, samples: np.ndarray) -> None:
    """Gray, or r, g, b."""
    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    height, width = samples.shape[:2]
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in samples)
    head = struct.pack(">2I5B", width, height, 16, 0 if samples.ndim == 2 else 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def write_dng(path: pathlib.Path, codes: np.ndarray) -> None:
    """An uncompressed mosaic, DNG 1.4: codes of 14 bits, the highest bit first."""
    bits = (codes[..., None] >> np.arange(BITS - 1, -1, -1)) & 1
    strip = np.packbits(bits.reshape(len(codes), -1).astype(np.uint8), axis=1).tobytes()
    tags: list[tuple[int, int, bytes]] = []  # number, type, values

    def tag(number: int, kind: int, *values: int) -> None:
        tags.append((number, kind, struct.pack(f"<{len(values)}{' BsHI'[kind]}", *values)))

    def text(number: int, value: bytes) -> None:
        tags.append((number, 2, value + b"\0"))

    height, width = codes.shape
    tag(254, 4, 0)  # NewSubfileType
    tag(256, 4, width)
    tag(257, 4, height)
    tag(258, 3, BITS)
    tag(259, 3, 1)  # Compression: none
    tag(262, 3, 32803)  # PhotometricInterpretation: a colour filter array
    text(271, b"Glasswing")
    text(272, b"Stand-in")
    tag(273, 4, 8)  # StripOffsets: after the head
    tag(274, 3, 1)  # Orientation
    tag(277, 3, 1)
    tag(278, 4, height)  # RowsPerStrip
    tag(279, 4, len(strip))
    tag(284, 3, 1)
    tag(33421, 3, 2, 2)  # CFARepeatPatternDim
    tag(33422, 1, 0, 1, 1, 2)  # CFAPattern: RGGB
    tags.append((33434, 5, struct.pack("<2I", 1, 50)))  # ExposureTime
    tag(50706, 1, 1, 4, 0, 0)  # DNGVersion
    text(50708, b"Glasswing Stand-in")
    tag(50714, 4, BLACK)
    tag(50717, 4, WHITE)
    # ColorMatrix1
    tags.append((50721, 10, struct.pack("<18i", *np.stack([np.eye(3, dtype=int).ravel(), np.ones(9, int)], 1).ravel())))
    tags.append((50728, 5, struct.pack("<6I", 1, 1, 1, 1, 1, 1)))  # AsShotNeutral
    size_of = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 10: 8}
    strip += b"\0" * (len(strip) % 2)
    directory, beyond = struct.pack("<H", len(tags)), b""
    start = 8 + len(strip)
    after = start + 2 + 12 * len(tags) + 4
    for number, kind, values in tags:
        directory += struct.pack("<2HI", number, kind, len(values) // size_of[kind])
        if len(values) <= 4:
            directory += values.ljust(4, b"\0")
        else:
            directory += struct.pack("<I", after + len(beyond))
            beyond += values + b"\0" * (len(values) % 2)
    path.write_bytes(struct.pack("<2sHI", b"II", 42, start) + strip + directory + b"\0" * 4 + beyond)


def run(program: str, *arguments: object) -> str:
    done = subprocess.run([str(BIN / program), *map(str, arguments)], capture_output=True, text=True, timeout=300.0)
    assert done.returncode == 0, f"{program} {' '.join(map(str, arguments))}: {done.stderr}"
    return done.stdout + done.stderr


def write_linear(folder: pathlib.Path, shown: list[dict[str, object]]) -> list[str]:
    """Linear mosaics, with the arguments that import them."""
    frames = []
    for i, stimulus in enumerate(shown):
        write_png16(folder / f"{i}.png", np.round(65535 * light_of(TRUTH, stimulus)).astype(np.uint16))
        frames.append({"file": f"{i}.png", "object": True, "stimulus": {**stimulus, "panel": "back"}})
    manifest = {"scene": "closed form", "monitor": {"back": dict(zip(("width", "height"), MONITOR))},
                "image": {"width": WIDTH, "height": HEIGHT}, "cfa": "RGGB", "frames": frames}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return [str(folder)]


def write_raw(folder: pathlib.Path, shown: list[dict[str, object]]) -> list[str]:
    """DNGs and their list, with the arguments that import them."""
    columns = ("phi_deg", "r_px", "sigma_px", "peak")
    lines = [f"#monitor back:{MONITOR[0]}x{MONITOR[1]}", "\t".join(("file", "object", "kind", "colour", *columns))]
    for i, stimulus in enumerate(shown):
        write_dng(folder / f"{i}.dng", np.round(BLACK + (WHITE - BLACK) * light_of(TRUTH, stimulus)).astype(np.uint16))
        colour = ",".join(str(c) for c in stimulus.get("colour", ()))
        fields = [str(stimulus.get(column, "")) for column in columns]
        lines.append("\t".join((f"{i}.dng", "true", str(stimulus["kind"]), colour, *fields)))
    (folder / "list.tsv").write_text("\n".join(lines) + "\n")
    return [str(folder), "--list", str(folder / "list.tsv")]


def allowed(step: float, shown: list[dict[str, object]]) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviations that quantisation in steps of `step` leaves to weight and centre (root of the two variances) and to
    the composite over the wave: the Cramer-Rao bound for errors of uniform distribution, of variance step^2 / 12, by numerical
    derivatives, and the rounding of a matte's numbers (docs/matte.md)."""
    def slopes(light) -> np.ndarray:
        columns = []
        for k in range(len(TRUTH)):
            up, down = TRUTH.copy(), TRUTH.copy()
            up[k] += 1e-4
            down[k] -= 1e-4
            columns.append((light(up) - light(down)) / 2e-4)
        return np.stack(columns, -1)

    jacobian = np.stack([slopes(lambda p, s=s: light_of(p, s)) for s in shown], -2)
    covariance = np.linalg.inv(np.swapaxes(jacobian, -1, -2) @ jacobian) * step**2 / 12
    wave = slopes(wave_light)
    centre_step = np.maximum(np.sqrt(0.5 * (covariance[..., 2, 2] + covariance[..., 3, 3])), 1 / 64) / 16
    weight_step = np.maximum(np.sqrt(covariance[..., 1, 1]), 1 / 4096) / 16
    for k, rounded in ((1, weight_step), (2, centre_step), (3, centre_step)):
        covariance[..., k, k] += rounded**2 / 12
    centre = np.sqrt(covariance[..., 2, 2] + covariance[..., 3, 3])
    return centre, np.sqrt(np.einsum("...i,...ij,...j", wave, covariance, wave))


def own(planes: dict[str, np.ndarray], name: str) -> np.ndarray:
    """Each photosite's own channel of `name`.R, .G and .B."""
    return np.choose(CHANNEL, [planes[f"{name}{c}"] for c in "RGB"])


def solved(work: pathlib.Path, name: str, imported: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Centres, and the composite over the wave."""
    archive, matte, composite = work / f"{name}.archive", work / f"{name}.exr", work / f"{name}-over.exr"
    run("glasswing", "import", *imported, "--archive", archive)
    run("glasswing-solver", "solve", archive, matte)
    run("glasswing", "composite", matte, "--background", work / "wave.png", "--linear", "--exact", "-o", composite)
    parts = read_exr(matte)
    assert not parts["foreground"]["flags.Y"].any(), f"{name} has flagged pixels"
    return np.stack([own(parts["mode1"], "x."), own(parts["mode1"], "y.")]), own(read_exr(composite)[""], "")


class RawSet(unittest.TestCase):
    def test_mattes_of_raw_and_of_linear_frames_agree(self) -> None:
        shown = stimuli()
        light = TRUTH[2:4], wave_light(TRUTH)
        # A raw sample is rounded a second time, to the 16 bits of an archive, whose full scale is the white level.
        full = WHITE / (WHITE - BLACK)
        allow = {"linear": allowed(1 / 65535, shown), "raw": allowed(np.hypot(full / WHITE, full / 65535), shown)}
        with tempfile.TemporaryDirectory() as temporary:
            work = pathlib.Path(temporary)
            x, y = np.meshgrid(np.arange(MONITOR[0]) + 0.5, np.arange(MONITOR[1]) + 0.5)
            picture = 0.5 + 0.4 * np.cos(2 * np.pi * (WAVE[0] * x + WAVE[1] * y))
            write_png16(work / "wave.png", np.repeat(np.round(65535 * picture)[..., None], 3, -1).astype(np.uint16))
            found = {}
            for name, write in (("linear", write_linear), ("raw", write_raw)):
                (work / name).mkdir()
                found[name] = solved(work, name, write(work / name, shown))
            camera = json.loads((work / "raw.archive/manifest.json").read_text())["camera"]
        self.assertEqual((camera["mosaic"], camera["bits"], camera["response"]), ("RGGB", BITS, "linear"))
        self.assertAlmostEqual(camera["black_level"], BLACK / WHITE, 12)
        for name, (centres, composite) in found.items():
            self.check(f"centres, {name}", np.hypot(*(centres - light[0])), allow[name][0])
            self.check(f"composite, {name}", composite - light[1], allow[name][1])
        both = [np.hypot(raw, linear) for raw, linear in zip(allow["raw"], allow["linear"])]
        self.check("centres, one against the other", np.hypot(*(found["raw"][0] - found["linear"][0])), both[0])
        self.check("composites, one against the other", found["raw"][1] - found["linear"][1], both[1])

    def check(self, what: str, error: np.ndarray, sd: np.ndarray) -> None:
        """Six standard deviations: one of 5e8 normal errors is larger, and there are 1200 pixels."""
        z = np.abs(error) / sd
        print(f"{what}: rms {np.sqrt((z**2).mean()):.2f}, at most {z.max():.1f} standard deviations")
        self.assertLess(z.max(), 6.0, what)


if __name__ == "__main__":
    unittest.main()
