// Fetches and decodes a matte and makes the compositor's footprints in a worker, so that the page stays responsive.
import { parsed } from "../parts/json";
import { unsolvedPixels } from "./fill_unsolved";
import { packFootprints } from "./footprints";
import type { LoadMessage, LoadRequest } from "./load";
import { readMatte, seeingBox } from "./matte";

/** Calls `report` with the fraction received, if the server gave the size. */
async function fetchBytes(url: string, report: (done: number) => void): Promise<Uint8Array<ArrayBuffer>> {
  const response = await fetch(url, { headers: { "X-Glasswing": "console" } });
  if (!response.ok) {
    const said = (await response.text().then(parsed).catch(() => ({}))) as { message?: string };
    throw new Error(said.message ?? `the server answered ${response.status} for ${url}`);
  }
  const total = Number(response.headers.get("Content-Length") ?? 0);
  // A matte may be a gigabyte: if its size is known, it is never in memory twice.
  let bytes = new Uint8Array(total);
  let length = 0;
  for (const reader = response.body!.getReader(); ;) {
    const { value, done } = await reader.read();
    if (done) break;
    if (length + value.length > bytes.length) {
      const larger = new Uint8Array(2 * (length + value.length));
      larger.set(bytes.subarray(0, length));
      bytes = larger;
    }
    bytes.set(value, length);
    length += value.length;
    if (total > 0) report(length / total);
  }
  return bytes.subarray(0, length);
}

const say = (message: LoadMessage, transfer: Transferable[] = []): void => postMessage(message, { transfer });

onmessage = async ({ data: { url, wants } }: MessageEvent<LoadRequest>) => {
  try {
    const bytes = await fetchBytes(url, (done) => say({ progress: 0.4 * done }));
    let told = 0;
    const matte = await readMatte(bytes, (done) => {
      if (done - told < 0.02 && done < 1) return;
      told = done;
      say({ progress: 0.4 + 0.4 * done });
    }, wants !== "values");
    if (wants !== "drawable") {
      const { foreground, coverage, flags, anyShape, firstMode, modes } = matte;
      const arrays = [foreground, coverage, flags, ...(anyShape ? [anyShape] : []), firstMode, modes];
      return say({ matte }, arrays.map(({ buffer }) => buffer));
    }
    const { metadata, width, height, foreground } = matte;
    const footprints = packFootprints(matte);
    const unsolved = unsolvedPixels(matte.flags);
    const seeing = seeingBox(matte);
    say({ drawable: { metadata, width, height, foreground, footprints, unsolved, seeing } }, [
      foreground.buffer,
      footprints.index.buffer,
      footprints.list.buffer,
      unsolved.buffer,
    ]);
  } catch (error) {
    say({ error: error instanceof Error ? error.message : String(error) });
  }
};
