import { afterEach, expect, test, vi } from "vitest";
import { kMostPixels, loadByLevels, matteUrl } from "../../src/light/load";

test("an address says what is wanted of a matte", () => {
  expect(matteUrl("a b")).toBe("/mattes/a%20b.exr");
  expect(matteUrl("s", { frame: 0, pixels: 10 })).toBe("/mattes/s.exr?frame=0&pixels=10");
  expect(matteUrl("s", { partial: true, region: { x: 1, y: 2, width: 3, height: 4 } })).toBe(
    "/mattes/s.exr?partial=1&crop=3x4%2B1%2B2",
  );
});

/** Answers each request as if the picture were of so many pixels. */
function standInOf(pixels: number, asked: string[]): void {
  class FakeWorker {
    onmessage: ((event: { data: unknown }) => void) | null = null;
    postMessage({ url }: { url: string }): void {
      asked.push(url);
      const most = Number(new URL(url).searchParams.get("pixels"));
      const sampling_px = Math.ceil(Math.sqrt(pixels / most));
      queueMicrotask(() => this.onmessage?.({ data: { drawable: { metadata: { sampling_px } } } }));
    }
    terminate(): void {}
  }
  vi.stubGlobal("Worker", FakeWorker);
  vi.stubGlobal("location", { href: "http://here/" });
}
afterEach(() => vi.unstubAllGlobals());

test("a large matte is drawn coarsely first, a small one once", async () => {
  for (const [pixels, steps] of [
    [12e6, [9, 3]],
    [1e6, [3, 1]],
    [1e5, [1]],
  ] as const) {
    const asked: string[] = [];
    standInOf(pixels, asked);
    const shown: number[] = [];
    await loadByLevels("s", {}, { signal: new AbortController().signal, report: () => undefined }, (matte) => {
      shown.push(matte.metadata.sampling_px ?? 1);
    });
    expect(shown).toEqual(steps);
    if (steps.length > 1) expect(asked[1]).toContain(`pixels=${kMostPixels}`);
  }
});
