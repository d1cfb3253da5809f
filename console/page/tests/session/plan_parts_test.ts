import { inflateSync } from "node:zlib";
import { describe, expect, it } from "vitest";
import { lightOf } from "../../src/light/srgb";
import { missingPhotos, photoName } from "../../src/session/photos";
import { linearPng } from "../../src/session/png16";

describe("photos", () => {
  it("are named by their files' stems unless the plan names them", () => {
    expect(photoName({ file: "../pictures/harbour.night.png" })).toBe("harbour.night");
    expect(photoName({ file: "harbour.png", name: "sea" })).toBe("sea");
  });
  it("are missing until a file of their name is picked", () => {
    const plan = { photos: [{ file: "../pictures/harbour.png" }, { file: "quilt.png" }] };
    expect(missingPhotos(plan, [{ name: "harbour.png" }])).toEqual(["quilt.png"]);
    expect(missingPhotos({}, [])).toEqual([]);
  });
});

describe("linearPng", () => {
  it("holds each code's light in 16 bits", async () => {
    const width = 3,
      height = 2;
    const data = Uint8ClampedArray.from({ length: 4 * width * height }, (_, i) => (37 * i) % 256);
    const png = Buffer.from(await (await linearPng({ data, width, height })).arrayBuffer());
    expect(png.toString("latin1", 1, 4)).toBe("PNG");
    expect([png.readUInt32BE(16), png.readUInt32BE(20), png[24], png[25]]).toEqual([width, height, 16, 2]);
    const start = png.indexOf("IDAT");
    const rows = inflateSync(png.subarray(start + 4, start + 4 + png.readUInt32BE(start - 4)));
    expect(rows.length).toBe(height * (1 + 6 * width));
    for (let pixel = 0; pixel < width * height; ++pixel) {
      const row = Math.floor(pixel / width);
      for (let colour = 0; colour < 3; ++colour) {
        const code = data[4 * pixel + colour]! / 255;
        expect(rows.readUInt16BE(row + 1 + 6 * pixel + 2 * colour)).toBe(Math.round(65535 * lightOf(code)));
      }
    }
  });
});
