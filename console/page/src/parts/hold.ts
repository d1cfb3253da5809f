// This browser's hold of the rig. All its tabs belong to the hold, and one of them keeps it: the hold outlasts
// the reload of a page, and ends kLinger_s after the last tab was closed.
import { effect, signal } from "@preact/signals";
import { ApiError, call, holdToken, mayOperate, stream } from "../api";
import type { HoldRigResponseJson } from "../gen/glasswing/v1/rig_service_pb";
import { isPassing, waited } from "./feed";
import { errorText } from "./words";

interface Hold {
  token: string;
  reason: string;
}

const kKey = "hold";
const kLinger_s = 20;
const kRetry_s = 1;

function parsed(text: string | null): Hold | null {
  const { token, reason } = JSON.parse(text ?? "{}") as Partial<Hold>;
  return token ? { token, reason: reason ?? "" } : null;
}

export const hold = signal<Hold | null>(parsed(localStorage.getItem(kKey)));
/** Why the hold ended, unless by release; null: nothing to tell. */
export const holdLost = signal<string | null>(null);

addEventListener("storage", ({ key, newValue }) => key === kKey && (hold.value = parsed(newValue)));

function store(value: Hold | null): void {
  hold.value = value;
  if (value) localStorage.setItem(kKey, JSON.stringify(value));
  else localStorage.removeItem(kKey);
}

const calls = (reason: string, signal?: AbortSignal): AsyncGenerator<HoldRigResponseJson> =>
  stream<HoldRigResponseJson>(
    "RigService/HoldRig",
    { reason, lingerS: kLinger_s },
    signal ? { signal } : {},
  );

/** Holds the rig; keep() takes the hold over from the call that ends here. */
export async function holdRig(reason: string): Promise<void> {
  for await (const { token } of calls(reason)) {
    holdLost.value = null;
    store({ token: token ?? "", reason });
    return;
  }
}

export async function releaseRig(): Promise<void> {
  await call("RigService/ReleaseRig");
  store(null);
}

/** Keeps the hold until `signal` is aborted or the hold ends. */
async function keep({ reason }: Hold, signal: AbortSignal): Promise<void> {
  while (!signal.aborted) {
    try {
      for await (const _ of calls(reason, signal)); // answers once, then lasts as long as the hold
      if (!signal.aborted) store(null); // released, perhaps by another tab
      return;
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof ApiError && isPassing(error))) {
        store(null);
        holdLost.value = errorText(error);
        return;
      }
    }
    await waited(kRetry_s, signal);
  }
}

effect(() => void (holdToken.value = hold.value?.token ?? null));
effect(() => {
  const kept = hold.value;
  if (!kept || !mayOperate.value) return;
  const cancel = new AbortController();
  void navigator.locks
    .request(kKey, { signal: cancel.signal }, () => keep(kept, cancel.signal))
    .catch(() => undefined); // aborted before this tab was the one
  return () => cancel.abort();
});
