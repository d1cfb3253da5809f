import { expect, test } from "vitest";
import { unpredict } from "../../src/light/exr";
import { modesOf, readMatte, seeingBox, strongestMode, type Mode } from "../../src/light/matte";
import { predict } from "./exr_bytes";
import { matteBytes, type MatteText } from "./matte_bytes";
import { random } from "./random";

const kMonitors = [
  { name: "back", width_px: 64, height_px: 48 },
  { name: "left", width_px: 32, height_px: 32 },
];

function textOf(suffixes: string[], footprint?: string): MatteText {
  const next = random(11);
  const [width, height] = [7, 5];
  const table = Array.from({ length: width * height * suffixes.length }, (_, i) =>
    Array.from({ length: i % 3 }, (): Mode => {
      const [weight, x, y, xx, yy, weight_sd, centre_sd] = Array.from({ length: 7 }, () =>
        Math.fround(0.1 + 9 * next()),
      ) as [number, number, number, number, number, number, number];
      // Some weigh more than an object can send.
      return { weight: Math.fround(weight / 8), x, y, xx, xy: 0, yy, texture: i % 2, weight_sd, centre_sd };
    }),
  );
  return {
    width,
    height,
    suffixes,
    modeCount: 2,
    metadata: { format_version: 1, monitors: kMonitors, footprint },
    foreground: (pixel, channel) => Math.fround(0.01 * pixel + channel),
    modes: (pixel, channel) => table[pixel * suffixes.length + channel]!,
  };
}

const read = (bytes: Uint8Array<ArrayBuffer>) => readMatte(bytes, () => undefined);

test("what was written is read, in colour and gray", async () => {
  for (const suffixes of [["R", "G", "B"], ["Y"]]) {
    const text = textOf(suffixes);
    const matte = await read(matteBytes(text));
    expect([matte.width, matte.height, matte.modeChannels]).toEqual([7, 5, suffixes.length]);
    for (let pixel = 0; pixel < 35; ++pixel) {
      for (let channel = 0; channel < 3; ++channel) {
        expect(matte.foreground[3 * pixel + channel]).toBe(text.foreground(pixel, channel));
        expect(modesOf(matte, pixel, channel)).toEqual(
          text.modes(pixel, Math.min(channel, suffixes.length - 1)),
        );
      }
    }
  }
});

test("a pyramid stands for the modes of its monitor, where it is asked for", async () => {
  const text = textOf(["R", "G", "B"], "pyramid");
  // Blue of pixel (5, 1), which has two modes: a Gaussian of sigma 4 px, and its second mode.
  const pixel = 7 + 5;
  const [, second] = text.modes(pixel, 2) as [Mode, Mode];
  const place = 2 * 1024 ** 2 + 1024 * 2 + 1;
  const row = [6, 2, second.texture, 0.25, 0.01, 0.02, 2, 16, 24, place, 6 * 1024 ** 2 - place, 0.5, 0.125];
  const bytes = matteBytes({ ...text, pyramids: [[], row, [], [], []] });
  const drawn = await readMatte(bytes, () => undefined, true);
  const own = modesOf(drawn, pixel, 2);
  expect(own).toEqual([
    { weight: 0.5, x: 4 * (2 * 6 + 1), y: 4 * (2 * 7 + 1), xx: 16, xy: 0, yy: 16, texture: second.texture, weight_sd: 0, centre_sd: 0 },
    { ...second, weight: 0.125 },
  ]);
  expect(drawn.anyShape).toEqual(Uint8Array.from({ length: 35 }, (_, i) => Number(i === pixel)));
  expect(drawn.foreground[3 * pixel + 2]).toBeCloseTo(text.foreground(pixel, 2) + 0.25, 5);
  expect(modesOf(drawn, pixel, 1)).toEqual(text.modes(pixel, 1));
  const plain = await readMatte(bytes, () => undefined);
  expect(modesOf(plain, pixel, 2)).toEqual(text.modes(pixel, 2));
  expect(plain.metadata.warnings).toEqual([expect.stringMatching(/^2\.9 % of the object's pixels have footprints of any shape/)]);
  row[6] = 3000;
  await expect(read(matteBytes({ ...text, pyramids: [[], row, [], [], []] }))).rejects.toThrow("pyramids");
});

test("the strongest mode has the largest weight that an object can have", async () => {
  const text = textOf(["R", "G", "B"]);
  const matte = await read(matteBytes(text));
  for (let pixel = 0; pixel < 35; ++pixel) {
    const weights = text.modes(pixel, 1).map(({ weight }) => weight).filter((weight) => weight > 0 && weight <= 1.05);
    expect(strongestMode(matte, pixel, 1)?.weight).toBe(
      weights.length > 0 ? Math.max(...weights) : undefined,
    );
  }
});

test("prediction is undone, also of lines of odd length", () => {
  for (const length of [1, 2, 7, 256]) {
    const line = Buffer.from(Array.from({ length }, (_, i) => (i * i * 37) & 255));
    expect([...unpredict(predict(line))]).toEqual([...line]);
  }
});

test("what is no matte is refused in words", async () => {
  const good = matteBytes(textOf(["Y"]));
  const changed = (change: (bytes: Uint8Array<ArrayBuffer>) => void): Uint8Array<ArrayBuffer> => {
    const bytes = good.slice();
    change(bytes);
    return bytes;
  };
  await expect(read(new Uint8Array())).rejects.toThrow("does not begin like an OpenEXR file");
  await expect(read(changed((bytes) => (bytes[5] = 0)))).rejects.toThrow("not a multi-part OpenEXR file");
  await expect(read(good.slice(0, good.length - 40))).rejects.toThrow("damaged or not a matte");
  await expect(read(good.slice(0, 200))).rejects.toThrow("ends too early");
  await expect(read(matteBytes(textOf(["Y"], "disc")))).rejects.toThrow('its footprints are "disc"');
  await expect(read(matteBytes({ ...textOf(["Y"]), metadata: {} }))).rejects.toThrow("names no monitors");
  const far: Mode = { weight: 1, x: 0, y: 0, xx: 1, xy: 0, yy: 1, texture: 2, weight_sd: 0, centre_sd: 0 };
  await expect(read(matteBytes({ ...textOf(["Y"]), modes: () => [far] }))).rejects.toThrow(
    "pixel (0, 0) has values that are invalid in a matte",
  );
});

test("no changed byte makes anything but a matte or an error of ours", async () => {
  const good = matteBytes(textOf(["Y"]));
  const next = random(5);
  for (let i = 0; i < 400; ++i) {
    const bytes = good.slice();
    bytes[Math.floor(next() * bytes.length)]! ^= 1 << Math.floor(8 * next());
    await read(bytes).catch((error: unknown) =>
      expect(String(error)).toContain("the file is damaged or not a matte"),
    );
  }
});

test("the box of the pixels that see a picture holds every mode and no empty side", async () => {
  const mode: Mode = { weight: 1, x: 1, y: 1, xx: 1, xy: 0, yy: 1, texture: 0, weight_sd: 0, centre_sd: 0 };
  for (const [lit, box] of [
    [[8, 9, 16], { x: 1, y: 1, width: 2, height: 2 }],
    [[34], { x: 6, y: 4, width: 1, height: 1 }],
    [[], { x: 0, y: 0, width: 7, height: 5 }],
  ] as const) {
    const seen = new Set<number>(lit);
    const text = { ...textOf(["R", "G", "B"]), modes: (pixel: number, c: number) => (seen.has(pixel) && c === 1 ? [mode] : []) };
    expect(seeingBox(await read(matteBytes(text)))).toEqual(box);
  }
});
