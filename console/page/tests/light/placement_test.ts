import { expect, test } from "vitest";
import { placementOf } from "../../src/light/compositor";
import { inverse, primaryMix, type Matrix } from "../../src/light/primary_mix";

const picture = { width: 400, height: 300 };
const monitor = { width: 128, height: 64 };
const still = { keepShape: false, dx: 0, dy: 0, scale: 1 };

test("a picture that is stretched covers its monitor", () => {
  const { x, y, stepX, stepY } = placementOf(picture, monitor, still);
  expect([x, y, x + 128 * stepX, y + 64 * stepY]).toEqual([0, 0, 400, 300]);
});

test("a picture that keeps its shape covers its monitor, cut evenly where it is too long", () => {
  const { x, y, stepX, stepY } = placementOf(picture, monitor, { ...still, keepShape: true });
  expect(stepX).toBe(stepY);
  expect([x, x + 128 * stepX]).toEqual([0, 400]);
  expect(y).toBeGreaterThan(0);
  expect(y + y + 64 * stepY).toBeCloseTo(300, 9);
});

test("moved by so many pixels, a pixel shows what stood as far left of it; scaled, the middle stays", () => {
  const { x, stepX } = placementOf(picture, monitor, { ...still, dx: 10 });
  expect(x + 10 * stepX).toBeCloseTo(0, 9);
  const twice = placementOf(picture, monitor, { ...still, scale: 2 });
  expect(twice.x + 64 * twice.stepX).toBeCloseTo(200, 9);
  expect(twice.stepX).toBeCloseTo(stepX / 2, 12);
});

test("what one monitor's primaries become in the camera is taken back", () => {
  const share: Matrix = [0.9, 0.3, 0, 0.1, 1.5, 0.2, 0.02, 0.1, 0.7];
  const monitors = [
    { name: "back", width_px: 8, height_px: 8 },
    { name: "left", width_px: 8, height_px: 8 },
  ];
  const { seen, primaries } = primaryMix({ monitors, crosstalk: [{ share }, {}] });
  const times = (m: Matrix, v: number[]): number[] =>
    [0, 3, 6].map((at) => m[at]! * v[0]! + m[at + 1]! * v[1]! + m[at + 2]! * v[2]!);
  times(seen[0]!, [1, 1, 1]).forEach((each) => expect(each).toBeCloseTo(1, 12));
  times(primaries, times(seen[0]!, [0.2, 0.5, 0.9])).forEach((each, i) =>
    expect(each).toBeCloseTo([0.2, 0.5, 0.9][i]!, 12),
  );
  expect(times(seen[1]!, [0.2, 0.5, 0.9])).toEqual([0.2, 0.5, 0.9]);
  times(share, times(inverse(share), [3, 1, 2])).forEach((each, i) =>
    expect(each).toBeCloseTo([3, 1, 2][i]!, 12),
  );
});
