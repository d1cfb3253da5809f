// A folder of `glasswing web` below an address of its own, as on any static host, and its page in a browser.
import { createReadStream, statSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { open_browser } from "./browser.mjs";

const kTypes = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
  ".json": "application/json",
  ".png": "image/png",
};

async function served(folder) {
  const server = createServer((request, response) => {
    const path = join(folder, normalize(request.url.replace(/^\/some\/where/, "").replace(/\/$/, "/index.html")));
    try {
      const type = kTypes[extname(path)] ?? "application/octet-stream";
      response.writeHead(200, { "Content-Type": type, "Content-Length": statSync(path).size });
      createReadStream(path).pipe(response);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return server;
}

export async function wait_until_drawn(page) {
  for (let is_shown = false; !is_shown;) {
    await page.waitForFunction(() => document.querySelector("#stage").ariaBusy === "false", undefined, { timeout: 120_000 });
    // What is on the canvas is on the screen a frame later.
    is_shown = await page.evaluate(async () => {
      for (let frame = 0; frame < 2; ++frame) await new Promise(requestAnimationFrame);
      return document.querySelector("#stage").ariaBusy === "false";
    });
  }
}

/** Drags the picture away and back, and resolves once that is drawn; it does not come to rest until the page's rest() is called. */
export function move_and_return(page) {
  return page.evaluate(async () => {
    const stage = document.querySelector("#stage");
    const pointer = (type, x) => stage.dispatchEvent(new PointerEvent(type, { pointerId: 1, clientX: x }));
    stage.setPointerCapture = () => undefined;
    const clock = performance.now;
    performance.now = () => 0; // so that no time passes since the last move
    window.rest = () => (performance.now = clock);
    let drawn = 0;
    const fence = WebGL2RenderingContext.prototype.fenceSync;
    WebGL2RenderingContext.prototype.fenceSync = function (...args) {
      ++drawn;
      return fence.apply(this, args);
    };
    pointer("pointerdown", 0);
    for (const x of [40, 0]) {
      const before = drawn;
      pointer("pointermove", x);
      while (drawn === before) await new Promise(requestAnimationFrame);
    }
    pointer("pointerup", 0);
    WebGL2RenderingContext.prototype.fenceSync = fence;
    await new Promise(requestAnimationFrame);
  });
}

const kMoving_ms = 4000;

/** Pictures a second while a pointer moves by a pixel a picture: the median, and the best sixteenth. Each is `whole`, or drawn
 * coarsely where the page finds that it is slow. */
export function pace_of_moves(page, whole = true) {
  return page.evaluate(
    async ([time_ms, whole]) => {
      const stage = document.querySelector("#stage");
      const pointer = (type, x) => stage.dispatchEvent(new PointerEvent(type, { pointerId: 1, clientX: x }));
      stage.setPointerCapture = () => undefined;
      // Without a clock the page does not know that it is slow, and never draws coarsely.
      const clock = performance.now.bind(performance);
      if (whole) performance.now = () => 0;
      const fence = WebGL2RenderingContext.prototype.fenceSync;
      const times = [];
      WebGL2RenderingContext.prototype.fenceSync = function (...args) {
        times.push(clock());
        return fence.apply(this, args);
      };
      pointer("pointerdown", 0);
      for (let x = 1; clock() < times[0] + time_ms || x < 10; ++x) {
        pointer("pointermove", x);
        await new Promise(requestAnimationFrame);
      }
      pointer("pointerup", 0);
      performance.now = clock;
      WebGL2RenderingContext.prototype.fenceSync = fence;
      // The next picture begins once the one before is done.
      const gaps = times.slice(2).map((time, i) => time - times[i + 1]);
      gaps.sort((a, b) => a - b);
      return { median: 1000 / gaps[gaps.length >> 1], best: 1000 / gaps[gaps.length >> 4] };
    },
    [kMoving_ms, whole],
  );
}

/** `size`: of the page. Resolves to { page, complaints, close }; complaints are errors, and calls of another server. */
export async function open_folder(folder, size) {
  const server = await served(folder);
  const browser = await open_browser();
  const page = await browser.newPage({ viewport: size });
  const origin = `http://127.0.0.1:${server.address().port}`;
  const complaints = [];
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("request", (request) => {
    const url = request.url();
    if (![origin, "data:", "blob:"].some((begin) => url.startsWith(begin))) complaints.push(`it calls ${url}`);
  });
  // When the first drawing is on the canvas: as of moving pictures, before the exact one.
  await page.addInitScript(() => {
    const fence = WebGL2RenderingContext.prototype.fenceSync;
    WebGL2RenderingContext.prototype.fenceSync = function (...args) {
      WebGL2RenderingContext.prototype.fenceSync = fence;
      const drawn = fence.apply(this, args);
      const look = () => {
        if (this.getSyncParameter(drawn, this.SYNC_STATUS) === this.SIGNALED) window.first_ms = performance.now();
        else requestAnimationFrame(look);
      };
      look();
      return drawn;
    };
  });
  const began = performance.now();
  await page.goto(`${origin}/some/where/`);
  await page.locator("#stage:not([hidden])").waitFor();
  await wait_until_drawn(page);
  const exact_ms = performance.now() - began;
  const first_ms = await page.evaluate(() => window.first_ms);
  console.log(`first picture after ${Math.round(first_ms)} ms, the exact one after ${Math.round(exact_ms)} ms`);
  await page.addStyleTag({ content: "#controls { opacity: 0 !important; transition: none } #stage { outline: none !important }" });
  const close = async () => {
    await browser.close();
    server.close();
  };
  return { page, complaints, close };
}
