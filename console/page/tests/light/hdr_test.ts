import { describe, expect, it } from "vitest";
import { NotHdr, isHdr, putLight, readHdr } from "../../src/light/hdr";

const kHead = "#?RADIANCE\n# by hand\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1\n\n";
const bytes = (text: string, rest: number[]): Uint8Array =>
  Uint8Array.from([...[...text].map((letter) => letter.charCodeAt(0)), ...rest]);

describe("Radiance's .hdr", () => {
  it("is read in runs", () => {
    const row = [2, 2, 0, 8, 0x88, 128, 3, 64, 32, 16, 0x85, 8, 0x88, 0, 0x88, 129];
    const file = bytes(`${kHead}-Y 1 +X 8\n`, row);
    expect(isHdr(file)).toBe(true);
    const { width, height, codes } = readHdr(file);
    expect([width, height]).toEqual([8, 1]);
    expect([...codes.subarray(0, 12)]).toEqual([128, 64, 0, 129, 128, 32, 0, 129, 128, 16, 0, 129]);
    expect([...codes.subarray(28)]).toEqual([128, 8, 0, 129]);
  });

  it("is read as it is where rows are too short for runs", () => {
    const { codes } = readHdr(bytes(`${kHead}-Y 2 +X 1\n`, [1, 2, 3, 4, 5, 6, 7, 8]));
    expect([...codes]).toEqual([1, 2, 3, 4, 5, 6, 7, 8]);
  });

  it("says what is wrong with it", () => {
    const row = [2, 2, 0, 8, 0x88, 128, 0x88, 64, 0x88, 0, 0x88, 129];
    for (let length = 0; length < row.length; ++length)
      expect(() => readHdr(bytes(`${kHead}-Y 1 +X 8\n`, row.slice(0, length)))).toThrow(NotHdr);
    expect(() => readHdr(bytes(`${kHead}-Y 1 +X 8\n`, [2, 2, 0, 8, 0x89, 128]))).toThrow("longer than it should be");
    expect(() => readHdr(bytes(`${kHead}+Y 1 +X 8\n`, row))).toThrow("-Y HEIGHT +X WIDTH");
    expect(() => readHdr(bytes("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n", []))).toThrow("32-bit_rle_xyze");
    expect(() => readHdr(bytes("\x89PNG\n", []))).toThrow('"#?"');
  });
});

describe("a code of light", () => {
  const coded = (...light: [number, number, number]): number[] => {
    const codes = new Uint8Array(4).fill(9);
    putLight(codes, 0, ...light);
    return [...codes];
  };
  it("is the nearest", () => {
    expect(coded(0.5, 0.25, 0)).toEqual([128, 64, 0, 128]); // code * 2^(exponent - 136)
    expect(coded(1, 1, 1)).toEqual([128, 128, 128, 129]);
    expect(coded(0.9999, 0, 0)).toEqual([128, 0, 0, 129]); // 256 would be no byte
  });
  it("has no light where there is none", () => {
    expect(coded(0, -3, NaN)).toEqual([0, 0, 0, 0]);
    expect(coded(Infinity, 0, 1)).toEqual([255, 0, 0, 255]);
  });
});
