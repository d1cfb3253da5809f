import { expect, test } from "vitest";
import { pointAt, regionAround } from "../../src/play/close_up";

test("a close-up lies around its point, and within the picture", () => {
  const picture = { width: 4000, height: 3000 };
  expect(regionAround(2000, 1500, picture)).toEqual({ x: 1360, y: 1020, width: 1280, height: 960 });
  expect(regionAround(0, 3000, picture)).toEqual({ x: 0, y: 2040, width: 1280, height: 960 });
  expect(regionAround(4000, -5, picture)).toEqual({ x: 2720, y: 0, width: 1280, height: 960 });
  expect(regionAround(100, 100, { width: 800, height: 3000 })).toEqual({ x: 0, y: 0, width: 800, height: 960 });
});

test("a point is found where the picture has bars beside it, and above it", () => {
  const picture = { width: 4000, height: 3000 };
  const at = (width: number, height: number, clientX: number, clientY: number) =>
    pointAt({ left: 10, top: 20, width, height } as DOMRect, { clientX, clientY }, picture);
  expect(at(800, 300, 10 + 200, 20)).toEqual({ x: 0, y: 0 }); // 400 x 300 in the middle
  expect(at(800, 300, 10 + 600, 20 + 300)).toEqual({ x: 4000, y: 3000 });
  expect(at(400, 500, 10 + 200, 20 + 250)).toEqual({ x: 2000, y: 1500 });
});
