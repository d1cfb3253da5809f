import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { afterAll, describe, expect, test } from "vitest";
import { archiveIn, batches, contents, type Files } from "../../src/session/import_archive";
import { filesOfTar } from "../../src/session/tar";

const scratch = mkdtempSync(join(tmpdir(), "import-"));
afterAll(() => rmSync(scratch, { recursive: true }));

/** What tar(1) packs of `files`. */
function tarOf(files: Record<string, string>, format: string): Uint8Array<ArrayBuffer> {
  const folder = mkdtempSync(join(scratch, "tar-"));
  for (const [path, text] of Object.entries(files)) {
    mkdirSync(dirname(join(folder, path)), { recursive: true });
    writeFileSync(join(folder, path), text);
  }
  execFileSync("tar", [`--format=${format}`, "-cf", join(scratch, "a.tar"), "-C", folder, "."]);
  return new Uint8Array(readFileSync(join(scratch, "a.tar")));
}

const textsOf = async (files: Files): Promise<Record<string, string>> =>
  Object.fromEntries(
    await Promise.all([...files].map(async ([path, file]) => [path.replace("./", ""), await file.text()] as const)),
  );

describe("tar files", () => {
  const files = {
    "s/frames/000000.tif": "x".repeat(511),
    "s/frames/000001.tif": "y".repeat(1025),
    [`${"long".repeat(20)}/${"er".repeat(40)}/frames/1.tif`]: "",
    "s/manifest.json": "{}",
  };
  test.each(["ustar", "pax"])("are read as tar(1) packs them: %s", async (format) => {
    const tar = new Blob([tarOf(files, format)]);
    expect(await textsOf(await filesOfTar(tar, 10))).toEqual(files);
    await expect(filesOfTar(tar, 3)).rejects.toThrow("more than 3 files");
  });
  test("are refused if they end early or are something else", async () => {
    const bytes = tarOf({ "a.tif": "a".repeat(5000) }, "ustar");
    await expect(filesOfTar(new Blob([bytes.slice(0, 3000)]), 10)).rejects.toThrow("truncated");
    await expect(filesOfTar(new Blob([bytes.slice(0, 700)]), 10)).rejects.toThrow("truncated");
    await expect(filesOfTar(new Blob(["z".repeat(2048)]), 10)).rejects.toThrow("not a tar file");
    bytes[512] = 65; // in the header of a.tif
    await expect(filesOfTar(new Blob([bytes]), 10)).rejects.toThrow("not a tar file, or damaged");
  });
});

describe("archives", () => {
  const manifest = (frames: object[]): string => JSON.stringify({ session: "vase", frames });
  const filesFrom = (texts: Record<string, string>): Files =>
    new Map(Object.entries(texts).map(([path, text]) => [path, new Blob([text])]));
  const whole = {
    "vase/manifest.json": manifest([
      { file: "frames/0.tif", size_bytes: "3", checksum: "xxh3:0" },
      { file: "frames/1.tif" },
    ]),
    "vase/frames/0.tif": "abc",
    "vase/frames/1.tif": "defg",
    "vase/header.json": "{}",
  };
  test("have the manifest's frames in their order, each with its size", async () => {
    const { name, frames, bytes } = await archiveIn(filesFrom(whole));
    expect([name, bytes]).toEqual(["vase", 7]);
    expect(frames.map(({ record }) => record)).toEqual([
      { file: "frames/0.tif", size_bytes: "3", checksum: "xxh3:0" },
      { file: "frames/1.tif", size_bytes: "4" },
    ]);
    expect(await Promise.all(frames.map(({ file }) => file.text()))).toEqual(["abc", "defg"]);
  });
  test("are the same from a tar file", async () => {
    const tar = new Blob([tarOf(whole, "ustar")]);
    expect((await archiveIn(await contents(new Map([["vase.tar", tar]])))).bytes).toBe(7);
    await expect(contents(new Map([["vase.tar", new Blob(["no tar"])]]))).rejects.toThrow("vase.tar cannot");
  });
  test.each([
    ["there is no manifest.json", { "vase/frames/0.tif": "abc" }],
    ["there are 2 archives", { ...whole, "urn/manifest.json": "{}" }],
    ["vase/manifest.json is not a JSON object", { ...whole, "vase/manifest.json": "{" }],
    ["vase/manifest.json is not a JSON object", { ...whole, "vase/manifest.json": "null" }],
    ["the frame vase/ is missing", { ...whole, "vase/manifest.json": '{"frames": [null]}' }],
    ["vase/manifest.json lists no frames", { ...whole, "vase/manifest.json": "{}" }],
    ["vase/frames/0.tif has 2 bytes; vase/manifest.json lists it with 3", { ...whole, "vase/frames/0.tif": "ab" }],
    [
      "the frame vase/frames/2.tif is missing",
      { ...whole, "vase/manifest.json": manifest([{ file: "frames/2.tif" }]) },
    ],
  ])("that are not whole are one error: %s", async (message, texts) => {
    await expect(archiveIn(filesFrom(texts))).rejects.toThrow(message);
  });
});

test("batches keep every frame in its order and within their limits", () => {
  const sized = (size: number, i: number): { record: object; file: Blob } => ({
    record: { i },
    file: { size } as Blob,
  });
  const cases = [[], Array(2500).fill(10), [50e6, 1, 50e6], Array(9).fill(8 * 2 ** 20)];
  const counts = cases.map((sizes) => {
    const frames = sizes.map(sized);
    const cut = batches(frames);
    expect(cut.flat()).toEqual(frames);
    return cut.map(({ length }) => length);
  });
  expect(counts).toEqual([[], [1000, 1000, 500], [1, 1, 1], [4, 4, 1]]);
});
