import { expect, test } from "vitest";
import { packFootprints, placeOf, type Place } from "../../src/light/footprints";
import { toHalf } from "../../src/light/half";
import { readMatte, type Mode } from "../../src/light/matte";
import { kBorder, pyramidShape } from "../../src/light/pyramid_shape";
import { matteBytes } from "./matte_bytes";
import { random } from "./random";

const kFilter = [1, 5, 10, 10, 5, 1].map((each) => each / 32);

/** The weights of the picture's pixels from `first` on in a level's sample, along one axis. */
function pixelWeights(level: number): { first: number; weights: number[] } {
  let [first, weights] = [0, [1]];
  for (let l = 0; l < level; ++l) {
    const finer = Array.from({ length: 2 * weights.length + 4 }, () => 0);
    weights.forEach((weight, j) => kFilter.forEach((share, k) => (finer[2 * j + k]! += weight * share)));
    [first, weights] = [2 * first - 2, finer];
  }
  return { first, weights };
}

const normal = (z: number): number => {
  // Simpson's rule over the density.
  if (z < -8) return 0;
  if (z > 8) return 1;
  const steps = 400;
  let sum = 0;
  for (let i = 0; i <= steps; ++i) {
    const at = (z * i) / steps;
    sum += (i === 0 || i === steps ? 1 : i % 2 === 1 ? 4 : 2) * Math.exp(-0.5 * at * at);
  }
  return 0.5 + (sum * z) / (3 * steps * Math.sqrt(2 * Math.PI));
};

/** The parts of a Gaussian in a level's squares. */
const squares = (centre: number, variance: number, first: number, count: number): number[] =>
  Array.from({ length: count }, (_, i) => {
    const z = (edge: number): number => (edge - centre) / Math.sqrt(variance);
    return normal(z(first + i + 1)) - normal(z(first + i));
  });

function gaussian(part: Partial<Mode>): Mode {
  return { weight: 1, x: 400, y: 400, xx: 1, xy: 0, yy: 1, texture: 0, weight_sd: 0, centre_sd: 0, ...part };
}

test("a level's filter has the variance 5 (4^l - 1) / 12, and loses no light", () => {
  for (let level = 0; level < 6; ++level) {
    const { first, weights } = pixelWeights(level);
    const middles = weights.map((_, i) => first + i + 0.5);
    const sum = weights.reduce((a, b) => a + b, 0);
    const mean = weights.reduce((a, weight, i) => a + weight * middles[i]!, 0);
    const variance = weights.reduce((a, weight, i) => a + weight * (middles[i]! - mean) ** 2, 0);
    expect(sum).toBeCloseTo(1, 12);
    expect(mean).toBeCloseTo(2 ** level / 2, 9);
    expect(variance).toBeCloseTo((5 * (4 ** level - 1)) / 12, 8);
  }
});

test("squares of a level weigh pixels as the Gaussian on the picture itself does", () => {
  const shape = pyramidShape(800, 800);
  const next = random(3);
  for (const xx of [0.3, 2, 3, 9, 30, 111, 700]) {
    const mode = gaussian({ x: 400 + 16 * next(), xx, yy: xx });
    const place = placeOf(mode, shape, "gaussian");
    const count = 800;
    const exact = squares(mode.x, xx, 0, count);
    const found = Array.from({ length: count }, () => 0);
    const { first, weights } = pixelWeights(place.level);
    const scale = 2 ** place.level;
    const levelFirst = Math.floor(place.x - 6 * Math.sqrt(place.xx) - 1);
    squares(place.x, place.xx, levelFirst, 2 * (place.x - levelFirst) + 2).forEach((share, j) => {
      weights.forEach((weight, i) => {
        const at = scale * (levelFirst + j) + first + i;
        if (at >= 0 && at < count) found[at]! += share * weight;
      });
    });
    // Both have the same sum, mean and variance; the rest is of fourth order.
    const apart = Math.sqrt(
      exact.reduce((sum, each, i) => sum + (each - found[i]!) ** 2, 0) /
        exact.reduce((sum, each) => sum + each ** 2, 0),
    );
    expect(apart).toBeLessThan(0.035);
    const mean = (all: number[]): number => all.reduce((sum, each, i) => sum + each * (i + 0.5), 0);
    expect(mean(found)).toBeCloseTo(mean(exact), 2);
  }
});

test("the level suits the narrowest part, and on the picture Q is S", () => {
  const shape = pyramidShape(640, 480);
  const next = random(7);
  for (let i = 0; i < 500; ++i) {
    const [long, short] = [Math.exp(8 * next() - 2), Math.exp(6 * next() - 4)];
    const turn = Math.PI * next();
    const [c, s] = [Math.cos(turn), Math.sin(turn)];
    const mode = gaussian({
      xx: long * c * c + short * s * s,
      yy: long * s * s + short * c * c,
      xy: (long - short) * c * s,
    });
    const place: Place = placeOf(mode, shape, "gaussian");
    const determinant = place.xx * place.yy - place.xy * place.xy;
    expect(determinant).toBeGreaterThan(-1e-6 * Math.max(place.xx, place.yy) ** 2);
    if (place.level === 0)
      expect(place).toEqual({ level: 0, x: 400, y: 400, xx: mode.xx, xy: mode.xy, yy: mode.yy });
    else expect(determinant).toBeGreaterThanOrEqual(0.1 * Math.min(1, Math.max(place.xx, place.yy)));
  }
});

test("levels with their borders do not overlap", () => {
  for (const [width, height] of [
    [128, 96],
    [1920, 1080],
    [33, 7],
    [1, 1],
    [96, 1280],
  ] as const) {
    const { levels, ...whole } = pyramidShape(width, height);
    const boxes = levels.map((l) => ({
      left: l.x - kBorder,
      top: l.y - kBorder,
      right: l.x + l.width + kBorder,
      bottom: l.y + l.height + kBorder,
    }));
    boxes.forEach((a, i) => {
      expect(Math.min(a.left, a.top)).toBeGreaterThanOrEqual(0);
      expect(a.right <= whole.width && a.bottom <= whole.height).toBe(true);
      for (const b of boxes.slice(i + 1))
        expect(a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top).toBe(true);
    });
  }
});

test("modes that are alike in several channels are one footprint", async () => {
  const alike = gaussian({ x: 10, y: 12 });
  const bytes = matteBytes({
    width: 2,
    height: 1,
    suffixes: ["R", "G", "B"],
    modeCount: 1,
    foreground: () => 0,
    metadata: { monitors: [{ name: "back", width_px: 64, height_px: 48 }] },
    modes: (pixel, channel) => [
      { ...alike, weight: 0.25 * (channel + 1), x: pixel === 0 ? 10 : 10 + channel },
    ],
  });
  const { index, list } = packFootprints(await readMatte(bytes, () => undefined));
  expect([...index]).toEqual([0, 1, 1, 3]);
  expect([list[5]! & 0xffff, list[5]! >>> 16, list[6]! & 0xffff]).toEqual([0.25, 0.5, 0.75].map(toHalf));
});

test("the list of a large matte is a texture that graphics processors have", () => {
  // One footprint more than a square of 2048 texels takes.
  const [width, height] = [2049, 1024];
  const one = [1, 8, 8, 4, 0, 4, 0, 0, 0];
  const { list, listWidth, listHeight } = packFootprints({
    metadata: { monitors: [{ name: "back", width_px: 64, height_px: 48 }] },
    width,
    height,
    modeChannels: 1,
    foreground: new Float32Array(3 * width * height),
    coverage: new Float32Array(width * height),
    flags: new Uint8Array(width * height),
    firstMode: Uint32Array.from({ length: width * height + 1 }, (_, i) => i),
    modes: Float32Array.from({ length: one.length * width * height }, (_, i) => one[i % one.length]!),
  });
  expect(listWidth).toBe(4096);
  expect(listHeight).toBe(Math.ceil((2 * width * height) / 4096));
  expect(list.length).toBe(4 * listWidth * listHeight);
});

test("halves are the nearest", () => {
  const value = (bits: number): number =>
    bits >> 10 === 0 ? bits * 2 ** -24 : (1024 + (bits & 1023)) * 2 ** ((bits >> 10) - 25);
  for (let bits = 0; bits < 0x7bff; ++bits) {
    expect(toHalf(value(bits))).toBe(bits);
    expect(toHalf(0.6 * value(bits + 1) + 0.4 * value(bits))).toBe(bits + 1);
  }
  expect(toHalf(1e9)).toBe(0x7bff);
});
