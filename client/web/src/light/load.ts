// Loads mattes from the server in a worker.
import type { Drawable } from "./compositor";
import type { MatteData } from "./matte";

export interface LoadRequest {
  url: string;
  wants: "values" | "drawable";
}

export type LoadMessage =
  { progress: number } | { matte: MatteData } | { drawable: Drawable } | { error: string };

export interface LoadOptions {
  signal: AbortSignal;
  report: (done: number) => void;
}

export function matteUrl(session: string, frame?: number): string {
  return `/mattes/${encodeURIComponent(session)}.exr${frame === undefined ? "" : `?frame=${frame}`}`;
}

/** Of a session that is not solved yet: its newest draft, or what is solved so far. */
export function partialMatteUrl(session: string): string {
  return `${matteUrl(session)}?partial=1`;
}

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
      else reject(new Error("error" in data ? data.error : "the matte's reader answered something else"));
    };
    worker.postMessage({ ...request, url: new URL(request.url, location.href).href });
  });
}

export function loadMatte(url: string, options: LoadOptions): Promise<MatteData> {
  return load({ url, wants: "values" }, options, (message) =>
    "matte" in message ? message.matte : undefined,
  );
}

export function loadDrawable(url: string, options: LoadOptions): Promise<Drawable> {
  return load({ url, wants: "drawable" }, options, (message) =>
    "drawable" in message ? message.drawable : undefined,
  );
}
