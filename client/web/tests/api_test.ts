import { expect, test } from "vitest";
import { events, tokenIn } from "../src/api";

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
