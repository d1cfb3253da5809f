// Live data, polled or streamed; reconnects when the connection is lost.
import { useEffect, useState } from "preact/hooks";
import { ApiError, call, stream, type CallOptions } from "../api";

export interface Feed<T> {
  /** The newest value; up to date only while `live`. */
  value?: T;
  live: boolean;
  error?: unknown;
}

/** Status codes after which a retry can help. */
const kPassing = new Set([
  "UNAVAILABLE",
  "DEADLINE_EXCEEDED",
  "CANCELLED",
  "ABORTED",
  "INTERNAL",
  "UNKNOWN",
  "RESOURCE_EXHAUSTED",
]);
const kMaxWait_s = 5;

export function isPassing({ code }: ApiError): boolean {
  return kPassing.has(code);
}

export function waited(seconds: number, signal: AbortSignal): Promise<void> {
  return new Promise((resolve) => {
    const timer = setTimeout(resolve, 1000 * seconds);
    signal.addEventListener("abort", () => (clearTimeout(timer), resolve()), { once: true });
  });
}

/** Resolves when the page is visible. */
function seen(signal: AbortSignal): Promise<void> {
  if (!document.hidden) return Promise.resolve();
  return new Promise((resolve) => {
    const listening = new AbortController();
    const done = (): void => (listening.abort(), resolve());
    document.addEventListener("visibilitychange", () => document.hidden || done(), {
      signal: listening.signal,
    });
    signal.addEventListener("abort", done, { signal: listening.signal });
  });
}

/**
 * Runs `source` until `signal` is aborted. Pauses while the page is hidden, and retries after transient failures with growing
 * delays. Ends with any other failure, or when the source ends.
 */
export async function follow<T>(
  source: (signal: AbortSignal) => AsyncIterable<T>,
  tell: (change: { value: T } | { error: unknown; last: boolean }) => void,
  signal: AbortSignal,
): Promise<void> {
  for (let wait = 0.5; !signal.aborted;) {
    await seen(signal);
    const turn = new AbortController();
    const hide = (): void => (document.hidden ? turn.abort() : undefined);
    document.addEventListener("visibilitychange", hide, { signal: turn.signal });
    signal.addEventListener("abort", () => turn.abort(), { signal: turn.signal });
    if (signal.aborted) return;
    try {
      for await (const value of source(turn.signal)) {
        if (turn.signal.aborted) break;
        wait = 0.5;
        tell({ value });
      }
      if (!turn.signal.aborted) return;
    } catch (error) {
      if (signal.aborted) return;
      if (!turn.signal.aborted) {
        const last = !(error instanceof ApiError && isPassing(error));
        tell({ error, last });
        if (last) return;
        await waited(wait, signal);
        wait = Math.min(2 * wait, kMaxWait_s);
      }
    } finally {
      turn.abort();
    }
  }
}

/** The latest value of `source`, followed while the component is mounted; restarts when `keys` change. */
export function useFeed<T>(
  source: (signal: AbortSignal) => AsyncIterable<T>,
  keys: readonly unknown[],
): Feed<T> {
  const [feed, setFeed] = useState<Feed<T>>({ live: false });
  useEffect(() => {
    const cancel = new AbortController();
    setFeed({ live: false });
    void follow(
      source,
      (change) =>
        setFeed((old) =>
          "error" in change
            ? { ...old, live: false, error: change.error }
            : { value: change.value, live: true },
        ),
      cancel.signal,
    );
    return () => cancel.abort();
  }, keys);
  return feed;
}

const kPollTimeout_ms = 10_000;

/** Repeats a call every `seconds`. */
export async function* polled<Answer>(
  method: string,
  request: object,
  seconds: number,
  options: CallOptions & { signal: AbortSignal },
): AsyncGenerator<Answer> {
  while (!options.signal.aborted) {
    const signal = AbortSignal.any([options.signal, AbortSignal.timeout(kPollTimeout_ms)]);
    yield await call<Answer>(method, request, { ...options, signal });
    await waited(seconds, options.signal);
  }
}

/** A stream that ends when no change is expected; reopened every `seconds` in case something changed. */
export async function* watched<Answer>(
  method: string,
  request: object,
  seconds: number,
  options: CallOptions & { signal: AbortSignal },
): AsyncGenerator<Answer> {
  while (!options.signal.aborted) {
    yield* stream<Answer>(method, request, options);
    await waited(seconds, options.signal);
  }
}
