"""An archive by brute force: a defocused lens before a monitor. A pixel of the camera sees a ring of the monitor around its own
place there, by exact sums over the monitor's flat pixels."""

import json
import pathlib
import struct
from collections.abc import Callable

import numpy as np

WIDTH, HEIGHT = 128, 96  # of the monitor
WEIGHT, FOREGROUND = 0.6, 0.02
SWEEPS = ((0, 4.0), (90, 4.0), (45, 4.0), (-45, 4.0))  # degrees, sigma in px
STEP_PX = 3.0

View = Callable[[np.ndarray], np.ndarray]  # what a monitor shows, as a camera sees it


def write_frame(path: pathlib.Path, light: np.ndarray) -> None:
    """A plain TIFF, as docs/archive.md has it: height x width x 3."""
    height, width, _ = light.shape
    pixels = np.round(65535 * np.clip(light, 0, 1)).astype("<u2").tobytes()
    short, long, bits_at = 3, 4, 200
    entries = [(256, long, 1, width), (257, long, 1, height), (258, short, 3, bits_at), (259, short, 1, 1), (262, short, 1, 2),
               (273, long, 1, 256), (274, short, 1, 1), (277, short, 1, 3), (278, long, 1, height), (279, long, 1, len(pixels)), (284, short, 1, 1)]
    head = struct.pack("<2sHIH", b"II", 42, 8, len(entries)) + b"".join(struct.pack("<HHII", *entry) for entry in entries)
    path.write_bytes((head.ljust(bits_at, b"\0") + struct.pack("<3H", 16, 16, 16)).ljust(256, b"\0") + pixels)


def ring(x: float, y: float, radius: float = 12.0, width: float = 1.5) -> np.ndarray:
    """The shares of the monitor's pixels, height x width, which sum to 1."""
    samples = 5  # across a pixel
    at = (np.arange(samples) + 0.5) / samples
    reach = radius + 6 * width
    left, right = max(0, int(x - reach)), min(WIDTH, int(x + reach) + 1)
    top, bottom = max(0, int(y - reach)), min(HEIGHT, int(y + reach) + 1)
    u = (np.arange(left, right)[:, None] + at).ravel() - x
    v = (np.arange(top, bottom)[:, None] + at).ravel() - y
    light = np.exp(-0.5 * ((np.hypot(u, v[:, None]) - radius) / width) ** 2)
    shares = np.zeros((HEIGHT, WIDTH))
    shares[top:bottom, left:right] = light.reshape(bottom - top, samples, right - left, samples).sum((1, 3))
    return shares / shares.sum()


def rings(columns: int, rows: int, margin_px: float = 20.0) -> np.ndarray:
    """(rows, columns, HEIGHT, WIDTH): of each pixel, evenly spread over the monitor."""
    place = lambda i, count, side: margin_px + (i + 0.5) / count * (side - 2 * margin_px)
    return np.stack([np.stack([ring(place(i, columns, WIDTH), place(j, rows, HEIGHT)) for i in range(columns)])
                     for j in range(rows)]).astype(np.float32)


def stimuli(width: int = WIDTH, height: int = HEIGHT) -> list[tuple[dict, np.ndarray]]:
    """Stimuli and what the monitor shows of them, gray."""
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    shown = [({"kind": "solid", "colour": [light] * 3, "panel": "back"}, np.full((height, width), float(light))) for light in (0, 1)]
    for degrees, sigma in SWEEPS:
        phi = np.radians(degrees)
        along = x * np.cos(phi) + y * np.sin(phi)
        for r in np.arange(along.min() - 3 * sigma, along.max() + 3 * sigma, STEP_PX):
            stripe = {"kind": "gauss_stripe", "phi_deg": degrees, "r_px": r, "sigma_px": sigma, "peak": 1.0, "colour": [1, 1, 1], "panel": "back"}
            shown.append((stripe, np.exp(-((along - r) ** 2) / (2 * sigma**2))))
    return shown


def write_archive(folder: pathlib.Path, seen: np.ndarray, noise_sd: float = 0.005) -> None:
    """`seen`: (rows, columns, HEIGHT, WIDTH) shares. The outermost pixels of the camera's picture see the monitor without the
    object."""
    rows, columns = seen.shape[:2]
    straight = (np.arange(rows)[:, None] * HEIGHT // rows, np.arange(columns)[None] * WIDTH // columns)
    border = np.ones((rows, columns), bool)
    border[:, 1:-1] = False

    def look(shown: np.ndarray) -> np.ndarray:
        through = (seen.reshape(rows * columns, -1) @ shown.astype(np.float32).ravel()).reshape(rows, columns)
        return np.where(border, shown[straight], FOREGROUND + WEIGHT * through)

    write_views(folder, "ring", look, lambda shown: shown[straight], stimuli(), noise_sd)


def bars(width: int, height: int, levels: int = 7) -> list[tuple[dict, np.ndarray]]:
    """The same of square waves and their complements, which show where the object is."""
    shown = []
    period = 2 ** int(np.ceil(np.log2(max(width, height))))
    for orient, place in (("vertical_bars", np.arange(width)[None]), ("horizontal_bars", np.arange(height)[:, None])):
        for level in range(1, levels + 1):
            for inverse in (False, True):
                bar = period // 2**level
                lit = (((place + 0.5) // bar % 2 == 0) != inverse) * np.ones((height, width))
                shown.append(({"kind": "square", "orient": orient, "level": level, "bar_width_px": bar, "inverse": inverse,
                               "colour": [1, 1, 1], "panel": "back"}, lit))
    return shown


def write_views(folder: pathlib.Path, scene: str, look: View, look_at_nothing: View, shown_by: list[tuple[dict, np.ndarray]], noise_sd: float) -> None:
    """An archive of what a camera sees of stimuli: `look` with the object, `look_at_nothing` without, gray."""
    random = np.random.default_rng(1)
    frames = []
    folder.mkdir(parents=True)
    for number, (stimulus, shown) in enumerate(shown_by):
        views = {True: look(shown)}
        if stimulus["kind"] in ("solid", "square"):
            views[False] = look_at_nothing(shown)
        for is_object, light in views.items():
            name = f"{'obj' if is_object else 'bg'}_{number:03}.tiff"
            noisy = light[..., None] * np.ones(3) + noise_sd * random.standard_normal((*light.shape, 3))
            write_frame(folder / name, noisy)
            frames.append({"file": name, "object": is_object, "stimulus": stimulus})
    height, width = shown_by[0][1].shape
    rows, columns = views[True].shape
    manifest = {"scene": scene, "monitor": {"back": {"width": width, "height": height}}, "image": {"width": columns, "height": rows},
                "sensor": {"read_noise_sd": max(noise_sd, 1e-5)}, "frames": frames}
    (folder / "manifest.json").write_text(json.dumps(manifest))
