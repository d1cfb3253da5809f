import { afterEach, expect, test, vi } from "vitest";
import { call, events, stream, tokenIn } from "../src/api";

const kText =
  ': alive\n\ndata: {"step":1}\n\ndata: {"what":"größer"}\n\nevent: end\ndata: {"code":"OK","message":""}\n\n';

test("events are whole, wherever the stream is cut", async () => {
  const bytes = new TextEncoder().encode(kText);
  for (const length of [1, 2, 7, bytes.length]) {
    const parts = Array.from({ length: Math.ceil(bytes.length / length) }, (_, i) =>
      bytes.slice(i * length, (i + 1) * length),
    );
    const found = [];
    const body = new ReadableStream<Uint8Array<ArrayBuffer>>({
      start: (control) => {
        for (const part of parts) control.enqueue(part);
        control.close();
      },
    });
    for await (const event of events(body)) found.push(event);
    expect(found).toEqual([
      { kind: "message", data: '{"step":1}' },
      { kind: "message", data: '{"what":"größer"}' },
      { kind: "end", data: '{"code":"OK","message":""}' },
    ]);
  }
});

test("a link's token is all that follows #token=", () => {
  expect(tokenIn("http://127.0.0.1:7480/#token=5f3a")).toBe("5f3a");
  expect(tokenIn("#token=")).toBe("");
  expect(tokenIn("#/session/token=5f3a")).toBeUndefined();
  expect(tokenIn("5f3a")).toBeUndefined();
});

afterEach(() => vi.unstubAllGlobals());

// U+202E would show "exe.gnp" for "png.exe".
test("texts of others cannot turn the direction of writing, nor hide characters", async () => {
  const text = "gläsern שלום \u202egnp\u2066\u001b[2J\u0000\u2028\n\t";
  const shown = "gläsern שלום \\u202egnp\\u2066\\u001b[2J\\u0000\\u2028\n\t";
  const json = (value: unknown): string => JSON.stringify(value);
  const answers = (body: string, status = 200) =>
    vi.stubGlobal("fetch", () => Promise.resolve(new Response(body, { status })));
  answers(json({ nodes: [{ detail: text, disks: 3 }], note: text }));
  expect(await call("NodeService/ListNodes")).toEqual({ nodes: [{ detail: shown, disks: 3 }], note: shown });
  answers(json({ code: "ABORTED", message: text }), 409);
  await expect(call("NodeService/ListNodes")).rejects.toThrow(expect.objectContaining({ message: shown }));
  answers(`data: ${json({ what: text })}\n\nevent: end\ndata: ${json({ code: "ABORTED", message: text })}\n\n`);
  const watched = stream("SessionService/WatchSteps");
  expect((await watched.next()).value).toEqual({ what: shown });
  await expect(watched.next()).rejects.toThrow(expect.objectContaining({ message: shown }));
});
