// A fake server: the built pages, mattes from files, and answers given by a test.
import { createReadStream } from "node:fs";
import { readFile, stat } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";

const kPages = process.env.GLASSWING_CONSOLE_FILES ?? fileURLToPath(new URL("../../dist", import.meta.url));
const kTypes = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
  ".svg": "image/svg+xml",
};
const kPolicy =
  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; worker-src 'self'";

async function send_file(response, path, type) {
  const { size } = await stat(path);
  response.writeHead(200, {
    "Content-Type": type,
    "Content-Length": size,
    "Content-Security-Policy": kPolicy,
  });
  createReadStream(path).pipe(response);
}

async function send_stream(response, messages) {
  response.writeHead(200, { "Content-Type": "text/event-stream" });
  for await (const message of messages) {
    if (response.closed) return;
    response.write(`data: ${JSON.stringify(message)}\n\n`);
  }
  response.end('event: end\ndata: {"code":"OK"}\n\n');
}

async function body_of(request) {
  let text = "";
  for await (const part of request) text += part;
  try {
    return text === "" ? {} : JSON.parse(text);
  } catch {
    return text; // a plan's
  }
}

/**
 * `mattes`: a file for each "/mattes/..." address. `answer(path, body, query)`: the answer of any other address, or
 * undefined. `stream(path)`: an iterable of messages, or undefined. Resolves to { url, close }.
 */
export async function stand_in({ mattes = {}, answer = () => undefined, stream = () => undefined }) {
  const server = createServer(async (request, response) => {
    const url = new URL(request.url, "http://localhost");
    try {
      url.searchParams.delete("pixels"); // it leaves nothing out
      const matte = mattes[url.pathname + url.search];
      if (matte !== undefined) return await send_file(response, matte, "image/x-exr");
      const messages = stream(url.pathname);
      if (messages !== undefined) return await send_stream(response, messages);
      const said =
        url.pathname === "/me"
          ? { name: "tester", role: "operator" }
          : await answer(url.pathname, await body_of(request), url.searchParams);
      if (said !== undefined) {
        response.writeHead(200, { "Content-Type": "application/json" });
        return response.end(JSON.stringify(said));
      }
      const path = join(kPages, normalize(url.pathname === "/" ? "/index.html" : url.pathname));
      await send_file(response, path, kTypes[extname(path)] ?? "application/octet-stream");
    } catch {
      response.writeHead(404, { "Content-Type": "application/json" });
      response.end(JSON.stringify({ code: "NOT_FOUND", message: `there is no ${url.pathname}` }));
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return {
    url: `http://127.0.0.1:${server.address().port}`,
    close: () => (server.close(), server.closeAllConnections()),
  };
}

export const read_json = async (path) => JSON.parse(await readFile(path, "utf8"));

/** A fake server with one session, "it", that has this matte; `regions`: files by region. */
export function stand_in_of(matte, regions = {}) {
  const answer = { session: { name: "it", matteReady: true } };
  async function* watched() {
    yield answer;
    await new Promise(() => undefined); // nothing changes
  }
  return stand_in({
    mattes: {
      "/mattes/it.exr": matte,
      ...Object.fromEntries(
        Object.entries(regions).map(([crop, file]) => [`/mattes/it.exr?${new URLSearchParams({ crop })}`, file]),
      ),
    },
    answer: (path) => (path.endsWith("/GetSession") ? answer : undefined),
    stream: (path) => (path.endsWith("/WatchSession") ? watched() : undefined),
  });
}
