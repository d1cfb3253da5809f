// Calls to the server that the page came from: the rig's own services, in protobuf's JSON mapping.
import { computed, signal } from "@preact/signals";
import { parsed } from "./parts/json";

export interface Me {
  name: string;
  role: string;
  expires?: string;
}

/** The logged-in user; null: nobody; undefined: not known yet. */
export const me = signal<Me | null | undefined>(undefined);
/** Why the user was logged out, unless by choice. */
export const loggedOutBy = signal<Error | undefined>(undefined);
/** Since when the server does not answer; null: it does. */
export const silentSince = signal<Date | null>(null);
/** Viewers see no controls that the server would refuse. */
export const mayOperate = computed(() => me.value?.role === "operator");

/** Token of the hold (RigService.HoldRig) that this browser's calls belong to; null: none. */
export const holdToken = signal<string | null>(null);

/** An error that the server answered; `code` is gRPC's name of the status. */
export class ApiError extends Error {
  constructor(
    readonly code: string,
    message: string,
  ) {
    super(message);
  }
}

export interface CallOptions {
  /** The camera or display to call; default: the server. */
  node?: string;
  signal?: AbortSignal;
}

const kHeaders = { "Content-Type": "application/json", "X-Glasswing": "console" };

async function refusal(response: Response): Promise<ApiError> {
  const said = await response.text().then(parsed).catch(() => ({})) as { code?: string; message?: string };
  const error = new ApiError(
    said.code ?? "UNKNOWN",
    said.message ?? `the server answered ${response.status} ${response.statusText}`,
  );
  if (response.status === 401) {
    if (me.value) loggedOutBy.value = error;
    me.value = null;
  }
  return error;
}

const isTimeout = (reason: unknown): boolean =>
  reason instanceof DOMException && reason.name === "TimeoutError";

function unanswered(): ApiError {
  silentSince.value ??= new Date();
  return new ApiError("UNAVAILABLE", "the server does not answer");
}

/** fetch() whose failures are ApiErrors; UNAVAILABLE: no answer came. */
export async function ask(path: string, init: RequestInit = {}): Promise<Response> {
  const headers = { "X-Glasswing": "console", ...(init.headers as Record<string, string> | undefined) };
  const response = await fetch(path, { ...init, headers }).catch((error: unknown) => {
    if (init.signal?.aborted && !isTimeout(init.signal.reason)) throw error;
    throw unanswered();
  });
  // So the console says that the server does not answer.
  const isSilent = response.status === 503 && response.headers.has('Retry-After');
  silentSince.value = isSilent ? (silentSince.value ?? new Date()) : null;
  if (!response.ok) throw await refusal(response);
  return response;
}

function post(method: string, request: object, options: CallOptions): Promise<Response> {
  const path =
    options.node === undefined
      ? `/api/${method}`
      : `/api/nodes/${encodeURIComponent(options.node)}/${method}`;
  const hold: Record<string, string> = holdToken.value === null ? {} : { "X-Glasswing-Hold": holdToken.value };
  const init: RequestInit = {
    method: "POST",
    headers: { ...kHeaders, ...hold },
    body: JSON.stringify(request),
  };
  if (options.signal) init.signal = options.signal;
  return ask(path, init);
}

/** `method` is for example "SessionService/GetSession". Of a list, the answer has all pages (https://google.aip.dev/158). */
export async function call<Answer>(
  method: string,
  request: object = {},
  options: CallOptions = {},
): Promise<Answer> {
  const answer = parsed(await (await post(method, request, options)).text()) as Page;
  let token = answer.nextPageToken;
  while (token !== undefined) {
    const page = parsed(await (await post(method, { ...request, pageToken: token }, options)).text()) as Page;
    token = page.nextPageToken;
    for (const [key, value] of Object.entries(page))
      answer[key] = Array.isArray(value) ? [...((answer[key] ?? []) as unknown[]), ...value] : value;
  }
  delete answer.nextPageToken;
  return answer as Answer;
}

type Page = Record<string, unknown> & { nextPageToken?: string };

/** Yields the messages of a streaming method. Leaving the loop, or options.signal, cancels the call. */
export async function* stream<Answer>(
  method: string,
  request: object = {},
  options: CallOptions = {},
): AsyncGenerator<Answer> {
  const response = await post(method, request, options);
  if (!response.body) return;
  for await (const event of events(response.body)) {
    if (event.kind === "end") {
      const end = parsed(event.data) as { code: string; message: string };
      if (end.code === 'UNAVAILABLE' && options.node === undefined) throw unanswered();
      if (end.code !== "OK") throw new ApiError(end.code, end.message);
      return;
    }
    yield parsed(event.data) as Answer;
  }
  throw unanswered();
}

// The server sends a keep-alive every five seconds; a longer silence means that the stream is lost.
const kMaxSilence_ms = 20_000;

async function soon<T>(reading: Promise<T>): Promise<T> {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const silence = new Promise<never>(
    (_, reject) => (timer = setTimeout(() => reject(unanswered()), kMaxSilence_ms)),
  );
  return Promise.race([reading, silence]).finally(() => clearTimeout(timer));
}

interface ServerEvent {
  kind: string;
  data: string;
}

/** Parses server-sent events; comments are skipped. */
export async function* events(body: ReadableStream<Uint8Array<ArrayBuffer>>): AsyncGenerator<ServerEvent> {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  try {
    let rest = "";
    for (;;) {
      const { value, done } = await soon(reader.read()).catch((error: unknown) => {
        throw error instanceof ApiError || (error as Error).name === "AbortError" ? error : unanswered();
      });
      if (done) return;
      const blocks = (rest + value).split("\n\n");
      rest = blocks.pop() ?? "";
      for (const block of blocks) {
        const event = { kind: "message", data: "" };
        for (const line of block.split("\n")) {
          if (line.startsWith("event:")) event.kind = line.slice(6).trim();
          if (line.startsWith("data:")) event.data += line.slice(5).trim();
        }
        if (event.data !== "") yield event;
      }
    }
  } finally {
    await reader.cancel().catch(() => undefined);
  }
}

export async function login(token: string): Promise<void> {
  const response = await ask("/login", {
    method: "POST",
    headers: kHeaders,
    body: JSON.stringify({ token }),
  });
  loggedOutBy.value = undefined;
  me.value = (await response.json()) as Me;
}

export async function logout(): Promise<void> {
  await ask("/logout", { method: "POST", headers: kHeaders, body: "{}" });
  me.value = null;
}

/** The token of a login link, "...#token=...", which may be empty; undefined: this is not such a link. */
export function tokenIn(link: string): string | undefined {
  return /#token=(.*)$/.exec(link)?.[1];
}

function decoded(token: string): string {
  try {
    return decodeURIComponent(token);
  } catch {
    return "";
  }
}

/**
 * Logs in with the token in the address and removes it from there, unless the server does not answer; without
 * one, asks who is logged in.
 */
export async function begin(): Promise<void> {
  const token = tokenIn(location.hash);
  if (token !== undefined) {
    const forget = (): void => history.replaceState(null, '', `${location.pathname}#/`);
    const logIn = async (): Promise<void> => {
      const whole = decoded(token);
      if (whole !== "") return login(whole);
      me.value = null;
      throw new Error("this link is incomplete: it must end with #token= and a token; copy all of it");
    };
    return logIn().then(forget, (error: unknown) => {
      if (!(error instanceof ApiError && error.code === "UNAVAILABLE")) forget();
      throw error;
    });
  }
  me.value = (await (await ask("/me")).json()) as Me;
}
