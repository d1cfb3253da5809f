import { readFileSync } from "node:fs";
import { deflateSync } from "node:zlib";
import { describe, expect, it } from "vitest";
import { isExr, NotExr, readExrPicture } from "../../src/light/exr_picture";
import { toHalf } from "../../src/light/half";
import { exrBytes, predict } from "./exr_bytes";

const kLight = [
  [0.5, 0.25, 0],
  [60, 45, 25],
  [1e-3, 2e-3, 4e-3],
  [1, 1, 1],
  [-1, 0.75, 2],
  [0.125, 8, 0.5],
] as const;
const [kWidth, kHeight] = [3, 2];

const int = (value: number): Buffer => {
  const out = Buffer.alloc(4);
  out.writeInt32LE(value);
  return out;
};
const attribute = (name: string, type: string, value: Buffer): Buffer =>
  Buffer.concat([Buffer.from(`${name}\0${type}\0`), int(value.length), value]);

/** By openexr.com's file layout: one part, B, G and R of halves, by a compression's number. */
function halves(compression: number, pack: (line: Buffer) => Buffer, lines: number, version = 2): Uint8Array<ArrayBuffer> {
  const window = Buffer.concat([5, -1, 5 + kWidth - 1, -1 + kHeight - 1].map(int));
  const channels = ["B", "G", "R"].map((name) => Buffer.concat([Buffer.from(`${name}\0`), int(1), int(0), int(1), int(1)]));
  const head = Buffer.concat([
    int(20000630),
    int(version),
    attribute("channels", "chlist", Buffer.concat([...channels, Buffer.from([0])])),
    attribute("compression", "compression", Buffer.from([compression])),
    attribute("dataWindow", "box2i", window),
    attribute("lineOrder", "lineOrder", Buffer.from([0])),
    Buffer.from([0]),
  ]);
  const rows = Array.from({ length: kHeight }, (_, y) =>
    Buffer.concat(
      [2, 1, 0].flatMap((c) =>
        kLight.slice(y * kWidth, (y + 1) * kWidth).map((light) => {
          const out = Buffer.alloc(2);
          out.writeUInt16LE(light[c]! < 0 ? toHalf(-light[c]!) | 0x8000 : toHalf(light[c]!));
          return out;
        }),
      ),
    ),
  );
  const chunks: Buffer[] = [];
  for (let y = 0; y < kHeight; y += lines) {
    const plain = Buffer.concat(rows.slice(y, y + lines));
    const packed = pack(plain);
    chunks.push(Buffer.concat([int(y - 1), int(packed.length), packed]));
  }
  let at = head.length + 8 * chunks.length;
  const table = chunks.map((chunk) => {
    const out = Buffer.alloc(8);
    out.writeBigUInt64LE(BigInt(at));
    at += chunk.length;
    return out;
  });
  return new Uint8Array(Buffer.concat([head, ...table, ...chunks]));
}

/** Runs of one byte only, the simplest of OpenEXR's RLE. */
const run = (line: Buffer): Buffer => Buffer.from([...predict(line)].flatMap((byte) => [0, byte]));
/** Bytes as they are. */
const literal = (line: Buffer): Buffer => Buffer.concat([Buffer.from([256 - line.length]), predict(line)]);

function expectLight({ width, height, codes }: { width: number; height: number; codes: Uint8Array }): void {
  expect([width, height]).toEqual([kWidth, kHeight]);
  kLight.forEach((light, pixel) => {
    const unit = 2 ** (codes[4 * pixel + 3]! - 136);
    const most = Math.max(...light);
    light.forEach((each, c) =>
      expect(Math.abs(codes[4 * pixel + c]! * unit - Math.max(each, 0))).toBeLessThanOrEqual(most / 250),
    );
  });
}

describe("OpenEXR as light", () => {
  it.each([
    ["none", 0, (line: Buffer) => line, 1],
    ["RLE, runs", 1, run, 1],
    ["RLE, bytes as they are", 1, literal, 1],
    ["ZIPS", 2, (line: Buffer) => deflateSync(predict(line)), 1],
    ["ZIP", 3, (line: Buffer) => deflateSync(predict(line)), 16],
  ] as const)("is read: %s", async (_, compression, pack, lines) => {
    const file = halves(compression, pack, lines);
    expect(isExr(file)).toBe(true);
    expectLight(await readExrPicture(file));
  });

  it("is read of 32-bit floats and the first of several parts", async () => {
    const channels = Object.fromEntries(["B", "G", "R"].map((name, i) => [name, kLight.map((light) => light[2 - i]!)]));
    const other = { name: "mask", channels: { Y: kLight.map(() => 7) } };
    expectLight(await readExrPicture(exrBytes([{ name: "light", channels }, other], kWidth, kHeight)));
  });

  it("says what is wrong with it", async () => {
    const file = halves(3, (line) => deflateSync(predict(line)), 16);
    for (let length = 4; length < file.length; ++length)
      await expect(readExrPicture(file.slice(0, length))).rejects.toThrow(NotExr);
    await expect(readExrPicture(halves(5, (line) => line, 16))).rejects.toThrow("its compression is PXR24; it must be none, RLE, ZIPS, ZIP, PIZ");
    await expect(readExrPicture(halves(0, (line) => line, 1, 0x202))).rejects.toThrow("tiles");
    const y = { name: "light", channels: { A: kLight.map(() => 1) } };
    await expect(readExrPicture(exrBytes([y], kWidth, kHeight))).rejects.toThrow("it must have R, G and B, or Y");
  });
});

// Written by OpenEXR 3.1 (Imf::OutputFile, PIZ_COMPRESSION), 45x39: two blocks, odd sides. Red has few words, green is smooth,
// blue jumps.
const pizLight = (x: number, y: number): [number, number, number] => [
  ((7 * x + 13 * y) % 64) / 16,
  (x + y) / 8,
  ((31 * x * x + 17 * y * y + 5 * x * y) % 1024) / 64,
];
const pizFile = (name: string): Uint8Array<ArrayBuffer> =>
  new Uint8Array(readFileSync(new URL(`./piz_${name}.exr`, import.meta.url)));

describe("PIZ", () => {
  it.each(["half", "float"])("is undone: %s", async (name) => {
    const { width, height, codes } = await readExrPicture(pizFile(name));
    expect([width, height]).toEqual([45, 39]);
    const wrong: string[] = [];
    for (let y = 0; y < height; ++y)
      for (let x = 0; x < width; ++x) {
        const at = 4 * (y * width + x);
        const light = pizLight(x, y);
        const unit = 2 ** (codes[at + 3]! - 136);
        light.forEach((each, c) => {
          if (Math.abs(codes[at + c]! * unit - each) > Math.max(...light) / 250) wrong.push(`${x},${y},${c}`);
        });
      }
    expect(wrong).toEqual([]);
  });

  it("is undone where words are too many for 14 bits", async () => {
    // 520x32 of Y, whose halves have the bits 0, 1, 2 ...
    const { codes } = await readExrPicture(pizFile("ramp"));
    for (let bits = 0; bits < 520 * 32; ++bits) {
      const [exponent, mantissa] = [bits >> 10, bits & 1023];
      const light = exponent === 0 ? mantissa * 2 ** -24 : (1024 + mantissa) * 2 ** (exponent - 25);
      const unit = 2 ** (codes[4 * bits + 3]! - 136);
      if (Math.abs(codes[4 * bits + 1]! * unit - light) > light / 250) expect.fail(`pixel ${bits}`);
    }
  });

  it("of a damaged file is an error of ours, or a picture", async () => {
    const whole = pizFile("half");
    for (let at = 340; at < whole.length; at += 61) {
      const file = whole.slice();
      file[at]! ^= 0x55;
      await readExrPicture(file).catch((error: unknown) => expect(error).toBeInstanceOf(NotExr));
      await expect(readExrPicture(whole.slice(0, at))).rejects.toThrow(NotExr);
    }
  });
});
