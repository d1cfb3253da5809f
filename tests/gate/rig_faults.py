#!/usr/bin/python3
"""rig_faults.py SCENE DIR FAULT[=STRENGTH]...  [seed=N] [sd=0.003] [bits=12]

Copies a rendered scene as a physical rig would have photographed it: each fault in turn, in the order of the manifest,
then white noise of the sensor and its bits. Reference photographs stay as they are."""

import functools
import json
import pathlib
import struct
import sys
import zlib

import numpy as np


# --- Pictures ------------------------------------------------------------------------------------------------


def read_png(path: pathlib.Path) -> np.ndarray:
    """A 16-bit picture, H x W x 3, 0 to 1."""
    data, at, parts = path.read_bytes(), 8, []
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height, bits, colour = struct.unpack_from(">IIBB", body)
        if kind == b"IDAT":
            parts.append(body)
        at += 12 + size
    channels = {0: 1, 2: 3}[colour]
    step = channels * bits // 8
    rows = np.frombuffer(zlib.decompress(b"".join(parts)), np.uint8).reshape(height, 1 + width * step)
    picture = np.zeros((height + 1, width + 1, step), np.uint8)
    for y in range(height):
        unfilter(int(rows[y, 0]), rows[y, 1:].reshape(width, step), picture[y], picture[y + 1])
    samples = picture[1:, 1:].reshape(height, width * channels, bits // 8)
    values = samples.astype(np.float64) @ (256.0 ** np.arange(bits // 8 - 1, -1, -1))
    values = values.reshape(height, width, channels) / (2**bits - 1)
    return np.repeat(values, 3, -1) if channels == 1 else values


def unfilter(kind: int, row: np.ndarray, above: np.ndarray, out: np.ndarray) -> None:
    if kind in (0, 2):
        out[1:] = row + (above[1:] if kind == 2 else 0)
        return
    for x in range(len(row)):
        left, up, corner = out[x].astype(int), above[x + 1].astype(int), above[x].astype(int)
        if kind == 1:
            guess = left
        elif kind == 3:
            guess = (left + up) // 2
        else:
            a, b, c = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
            guess = np.where((a <= b) & (a <= c), left, np.where(b <= c, up, corner))
        out[x + 1] = (row[x] + guess) & 255


def write_png(path: pathlib.Path, picture: np.ndarray) -> None:
    codes = np.round(np.clip(picture, 0, 1) * 65535).astype(">u2")
    height, width = codes.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), codes.reshape(height, -1).view(np.uint8)], 1)

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) +
                     chunk(b"IDAT", zlib.compress(rows.tobytes(), 1)) + chunk(b"IEND", b""))


def shifted(picture: np.ndarray, dx: float, dy: float) -> np.ndarray:
    """What lay at (x, y) lies at (x + dx, y + dy): by Fourier's theorem, mirrored at the edges."""
    height, width = picture.shape[:2]
    whole = np.concatenate([picture, picture[::-1]])
    whole = np.concatenate([whole, whole[:, ::-1]], 1)
    fx, fy = np.fft.fftfreq(2 * width)[None, :, None], np.fft.fftfreq(2 * height)[:, None, None]
    # Mirrored halves would move the other way: shift a picture that is continued, not mirrored, in the middle.
    whole = np.roll(whole, (height // 2, width // 2), (0, 1))
    moved = np.fft.ifft2(np.fft.fft2(whole, axes=(0, 1)) * np.exp(-2j * np.pi * (fx * dx + fy * dy)), axes=(0, 1))
    return np.roll(np.real(moved), (-(height // 2), -(width // 2)), (0, 1))[:height, :width]


# --- Faults --------------------------------------------------------------------------------------------------
# Each takes the frames (N x H x W x 3), what they show, a strength and a random generator.


class Shown:
    def __init__(self, frames: list[dict]):
        kinds = [frame["stimulus"]["kind"] for frame in frames]
        self.object = np.array([frame["object"] for frame in frames])
        self.stripe = np.array([kind == "gauss_stripe" for kind in kinds])
        self.part = np.arange(len(frames)) / max(len(frames) - 1, 1)
        self.white = np.array([kind == "solid" and frame["stimulus"]["colour"] == [1, 1, 1]
                               for kind, frame in zip(kinds, frames)])
        self.sweep = [frame["stimulus"].get("phi_deg") for frame in frames]


def each(gains: np.ndarray) -> np.ndarray:
    return gains[:, None, None, None]


def ghost(light, shown, share, _rng):
    return (1 - share) * light + share * np.concatenate([light[:1], light[:-1]])


def slow_ghost(light, shown, share, _rng):
    """What is left of a picture falls by the same factor with every picture: an exponential settling."""
    out = light.copy()
    for i in range(1, len(light)):
        out[i] = (1 - share) * light[i] + share * out[i - 1]
    return out


def warm_up(light, shown, fall, _rng):
    return light * each(1 - fall * shown.part)


def warm_up_curve(light, shown, fall, _rng):
    return light * each(1 - fall * (1 - np.exp(-5 * shown.part)))


def tint(light, shown, change, _rng):
    return light * (1 + change * shown.part[:, None] * np.array([1.0, 0.3, -0.5]))[:, None, None, :]


def object_gain(light, shown, gain, _rng):
    return light * each(np.where(shown.object, gain, 1.0))


def solid_gain(light, shown, gain, _rng):
    return light * each(np.where(shown.stripe, 1.0, gain))


def gain_step(light, shown, gain, rng):
    return light * each(np.where(shown.part > rng.uniform(0.3, 0.7), gain, 1.0))


def flicker(light, shown, sd, rng):
    return light * each(1 + sd * rng.standard_normal(len(light)))


def knock(light, shown, size, rng):
    return moved(light, shown, (shown.part > 0.5)[:, None] * size * direction(rng))


def creep(light, shown, size, rng):
    return moved(light, shown, shown.part[:, None] * size * direction(rng))


def vibration(light, shown, sd, rng):
    return moved(light, shown, sd * rng.standard_normal((len(light), 2)))


def direction(rng) -> np.ndarray:
    angle = rng.uniform(0, 2 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


def moved(light, shown, shifts):
    return np.stack([shifted(one, *shift) if np.any(shift) else one for one, shift in zip(light, shifts)])


def sheared(picture: np.ndarray, axis: int, shifts: np.ndarray) -> np.ndarray:
    """Each row (axis 1) or column (axis 0) moved along itself by its own shift: as shifted()."""
    length = picture.shape[axis]
    whole = np.roll(np.concatenate([picture, np.flip(picture, axis)], axis), length // 2, axis)
    along, across = [None, None, None], [None, None, None]
    along[axis], across[1 - axis] = slice(None), slice(None)
    phase = np.fft.fftfreq(2 * length)[tuple(along)] * shifts[tuple(across)]
    moved = np.real(np.fft.ifft(np.fft.fft(whole, axis=axis) * np.exp(-2j * np.pi * phase), axis=axis))
    return np.take(np.roll(moved, -(length // 2), axis), np.arange(length), axis)


def turn(light, shown, degrees, _rng):
    """A knock that turns the picture clockwise about its middle, to first order."""
    height, width = light.shape[1:3]
    angle = np.radians(degrees)
    down, left = angle * (np.arange(width) - (width - 1) / 2), -angle * (np.arange(height) - (height - 1) / 2)
    return np.stack([sheared(sheared(one, 0, down), 1, left) if part > 0.5 else one
                     for one, part in zip(light, shown.part)])


def two_steps(light, shown, share, _rng):
    """A rolling shutter whose lower rows are open while the next picture is there: the last by this share of their
    exposure."""
    height = light.shape[1]
    rows = (share * np.clip(2 * (np.arange(height) + 0.5) / height - 1, 0, 1))[:, None, None]
    return (1 - rows) * light + rows * np.concatenate([light[1:], light[-1:]])


def object_moved(light, shown, size, rng, mask):
    """After the first sweep, over a stage that stays where it is: the pictures without the object are not known for
    stripes, so what lies beside the object is continued from the unmoved picture."""
    first = shown.sweep[int(np.argmax(shown.stripe))]
    late = shown.object & (np.cumsum(shown.stripe) > sum(own == first for own in shown.sweep))
    shift = size * direction(rng)
    cover = np.clip(shifted(mask, *shift), 0, 1)
    out = light.copy()
    for i in np.flatnonzero(late):
        out[i] = cover * shifted(light[i], *shift) + (1 - cover) * light[i]
    return out


def door(light, shown, amount, rng):
    start = rng.uniform(0.2, 0.7)
    return light + each(np.where((shown.part > start) & (shown.part < start + 0.1), amount, 0.0))


def flare(light, shown, share, _rng):
    return (1 - share) * light + share * light.mean((1, 2), keepdims=True)


def bad_pixels(light, shown, share, rng):
    """Thirds are dead, stuck and noisy."""
    height, width = light.shape[1:3]
    kind = np.where(rng.uniform(size=(height, width)) < share, rng.integers(1, 4, (height, width)), 0)
    light = light.copy()
    light[:, kind == 1] = 0
    light[:, kind == 2] = rng.uniform(0.1, 1, (int((kind == 2).sum()), 3))
    light[:, kind == 3] += rng.normal(0, 0.2, (len(light), int((kind == 3).sum()), 3))
    return light


def srgb(light, shown, _strength, _rng):
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def gamma(light, shown, power, _rng):
    return np.clip(light, 0, 1) ** (1 / power)


def white_over(light, shown, gain, _rng):
    return light * each(np.where(shown.white, gain, 1.0))


def over(light, shown, gain, _rng):
    return light * gain


def black_level(light, shown, level, _rng):
    return level + (1 - level) * light


FAULTS = {name: function for name, function in list(globals().items())
          if callable(function) and getattr(function, "__module__", "") == __name__ and name not in
          ("read_png", "unfilter", "write_png", "shifted", "sheared", "Shown", "each", "direction", "moved")}


@functools.lru_cache(maxsize=1)
def read_scene(scene: pathlib.Path) -> tuple[dict, np.ndarray]:
    """The manifest and frames of a session, without photographs and ramps."""
    manifest = json.loads((scene / "manifest.json").read_text())
    frames = [frame for frame in manifest["frames"] if frame["stimulus"]["kind"] not in ("photo", "photo_multi", "ramp")]
    manifest["frames"] = frames
    return manifest, np.stack([read_png(scene / frame["file"]) for frame in frames])


def degrade(scene: pathlib.Path, out: pathlib.Path, faults: list[tuple[str, float]], seed=1, sd=0.003, bits=12,
            rows: slice = slice(None)) -> None:
    manifest, light = read_scene(scene)
    frames = manifest["frames"]
    shown, rng = Shown(frames), np.random.default_rng(seed)
    for name, strength in faults:
        extra = [read_png(scene / "mask_true.png")] if name == "object_moved" else []
        light = FAULTS[name](light, shown, strength, rng, *extra)
    light = light[:, rows]
    manifest = manifest | {"image": manifest["image"] | {"height": light.shape[1]}}
    full = 2**bits - 1
    for frame, picture in zip(frames, light):
        noisy = np.clip(picture + rng.normal(0, sd, picture.shape), 0, 1) if sd else picture
        write_png(out / frame["file"], np.round(np.clip(noisy, 0, 1) * full) / full)
    (out / "manifest.json").write_text(json.dumps(manifest))


def main() -> None:
    scene, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    words = dict(word.partition("=")[::2] for word in sys.argv[3:])
    settings = {"seed": int(words.pop("seed", 1)), "sd": float(words.pop("sd", 0.003)), "bits": int(words.pop("bits", 12))}
    degrade(scene, out, [(name, float(strength or 0)) for name, strength in words.items() if name != "none"], **settings)


if __name__ == "__main__":
    main()
