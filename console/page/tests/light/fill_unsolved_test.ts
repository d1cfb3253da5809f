import { expect, test } from "vitest";
import { fillUnsolved, unsolvedPixels } from "../../src/light/fill_unsolved";
import { kFlags } from "../../src/light/matte";

function picture(width: number, codes: number[]) {
  const data = new Uint8ClampedArray(codes.flatMap((code) => [code, code, code, 255]));
  return { width, height: codes.length / width, data };
}
const codesOf = ({ data }: { data: Uint8ClampedArray }): number[] => [...data].filter((_, i) => i % 4 === 0);

test("unsolved pixels are those of the flag alone", () => {
  const flags = Uint8Array.of(0, kFlags.notSolved, kFlags.saturated, kFlags.notSolved | kFlags.residual);
  expect([...unsolvedPixels(flags)]).toEqual([1, 3]);
});

test("a constant surround fills a hole of any depth with its own code", () => {
  const made = picture(5, Array.from({ length: 25 }, (_, i) => ([6, 7, 8, 11, 12, 13, 16, 17, 18].includes(i) ? 0 : 90)));
  fillUnsolved(made, Uint32Array.of(6, 7, 8, 11, 12, 13, 16, 17, 18));
  expect(codesOf(made)).toEqual(Array<number>(25).fill(90));
});

test("the mean is that of light, taken rim by rim", () => {
  const made = picture(4, [0, 7, 7, 255]);
  fillUnsolved(made, Uint32Array.of(1, 2));
  expect(codesOf(made)).toEqual([0, 0, 255, 255]); // each has one known neighbour
  const middle = picture(3, [0, 7, 255]);
  fillUnsolved(middle, Uint32Array.of(1));
  expect(codesOf(middle)[1]).toBe(188); // half of white's light in sRGB
});

test("a picture without any solved pixel stays", () => {
  const made = picture(2, [3, 4]);
  fillUnsolved(made, Uint32Array.of(0, 1));
  expect(codesOf(made)).toEqual([3, 4]);
});
