// Loads mattes from the server in a worker.
import type { Drawable } from "./compositor";
import { samplingOf, type Box, type MatteData } from "./matte";

export interface LoadRequest {
  url: string;
  /** "footprints": values with the Gaussians of pyramids in place of modes. */
  wants: "values" | "footprints" | "drawable";
}

export type LoadMessage =
  { progress: number } | { matte: MatteData } | { drawable: Drawable } | { error: string };

export interface LoadOptions {
  signal: AbortSignal;
  report: (done: number) => void;
}

export interface MatteChoice {
  /** Of a video. */
  frame?: number | undefined;
  /** Of a session that is not solved yet: its newest draft, or what is solved so far. */
  partial?: boolean;
  /** Part of the picture. */
  region?: Box | undefined;
  /** Rows and columns are left out until there are no more pixels than this. */
  pixels?: number;
}

export function matteUrl(session: string, { frame, partial, region, pixels }: MatteChoice = {}): string {
  const query = new URLSearchParams();
  if (frame !== undefined) query.set("frame", String(frame));
  if (partial) query.set("partial", "1");
  if (region) query.set("crop", `${region.width}x${region.height}+${region.x}+${region.y}`);
  if (pixels !== undefined) query.set("pixels", String(pixels));
  const text = query.toString();
  return `/mattes/${encodeURIComponent(session)}.exr${text === "" ? "" : `?${text}`}`;
}

/** The most pixels of a picture that a page shows: more would cost a gigabyte of memory and not be visible. */
export const kMostPixels = 1.5e6;
/** Loaded and drawn in a second or two. */
const kFirstPixels = 1.6e5;

function load<Result>(
  request: LoadRequest,
  { signal, report }: LoadOptions,
  take: (message: LoadMessage) => Result | undefined,
): Promise<Result> {
  return new Promise<Result>((resolve, reject) => {
    const worker = new Worker(new URL("./matte_worker.ts", import.meta.url), { type: "module" });
    const end = (): void => worker.terminate();
    signal.addEventListener("abort", end);
    worker.onerror = () => (end(), reject(new Error("the matte's reader could not be started")));
    worker.onmessage = ({ data }: MessageEvent<LoadMessage>) => {
      if ("progress" in data) return report(data.progress);
      end();
      const result = take(data);
      if (result) resolve(result);
      else reject(new Error("error" in data ? data.error : "the matte's reader gave an unexpected answer"));
    };
    worker.postMessage({ ...request, url: new URL(request.url, location.href).href });
  });
}

export function loadMatte(
  url: string,
  options: LoadOptions,
  wants: "values" | "footprints" = "values",
): Promise<MatteData> {
  return load({ url, wants }, options, (message) =>
    "matte" in message ? message.matte : undefined,
  );
}

export function loadDrawable(url: string, options: LoadOptions): Promise<Drawable> {
  return load({ url, wants: "drawable" }, options, (message) =>
    "drawable" in message ? message.drawable : undefined,
  );
}

/** Loads a matte of any size: of a large one a coarse picture first, then as much as a page shows. */
export async function loadByLevels(
  session: string,
  choice: MatteChoice,
  options: LoadOptions,
  show: (matte: Drawable) => void,
): Promise<void> {
  const first = await loadDrawable(matteUrl(session, { ...choice, pixels: kFirstPixels }), options);
  show(first);
  if (samplingOf(first.metadata) === 1) return;
  show(await loadDrawable(matteUrl(session, { ...choice, pixels: kMostPixels }), options));
}
