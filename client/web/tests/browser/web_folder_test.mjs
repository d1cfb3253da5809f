// Compares what the folder of `glasswing web` shows with `glasswing composite`, picture by picture:
//
//   node tests/browser/web_folder_test.mjs GLASSWING PLAYER MATTE.exr PICTURE.png...
//
// PLAYER is the built player's directory. Pictures have the monitors' shape. Prints sizes, the mean colour difference in 1/255 of
// sRGB and the time to the first picture, and fails if a mean exceeds 1 or if another server is called.
import { execFileSync } from "node:child_process";
import { createReadStream, mkdtempSync, readFileSync, rmSync, statSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { basename, extname, join, normalize } from "node:path";
import { open_browser } from "./browser.mjs";
import { difference, monitors_of } from "./mattes.mjs";

const kMaxMean = 1;
const kTypes = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json", ".png": "image/png" };

const [glasswing, player, matte, ...pictures] = process.argv.slice(2);
if (pictures.length === 0) {
  console.error("usage: web_folder_test.mjs GLASSWING PLAYER MATTE.exr PICTURE.png...");
  process.exit(2);
}
const work = mkdtempSync(join(tmpdir(), "web-folder-"));
const folder = join(work, "folder");
const run = (...args) => execFileSync(glasswing, args, { stdio: "pipe", encoding: "utf8" });
const offered = pictures.flatMap((picture) => ["--background", picture]);
const written = JSON.parse(run("--json", "web", matte, "-o", folder, "--player", player, "--title", "It", ...offered));
run("web", matte, "-o", folder, "--player", player, "--title", "It", ...offered); // takes the place of the first
console.log(`${written.width_px}x${written.height_px}: ${written.bytes} bytes, ${written.matte_bytes} of them the matte`);
const shown = JSON.parse(readFileSync(join(folder, "matte.json"), "utf8"));

// Below an address of its own, as on any static host.
const server = createServer((request, response) => {
  const path = join(folder, normalize(request.url.replace(/^\/some\/where/, "").replace(/\/$/, "/index.html")));
  try {
    response.writeHead(200, { "Content-Type": kTypes[extname(path)] ?? "application/octet-stream", "Content-Length": statSync(path).size });
    createReadStream(path).pipe(response);
  } catch {
    response.writeHead(404).end();
  }
});
await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
const origin = `http://127.0.0.1:${server.address().port}`;
const browser = await open_browser();
let failed = false;
try {
  // The canvas has one pixel for each of the matte.
  const page = await browser.newPage({ viewport: { width: shown.width_px, height: shown.height_px } });
  page.on("pageerror", (error) => ((failed = true), console.error(error.message)));
  page.on("request", (request) => {
    const url = request.url();
    if ([origin, "data:", "blob:"].some((begin) => url.startsWith(begin))) return;
    failed = true;
    console.error(`it calls ${url}`);
  });
  const began = performance.now();
  await page.goto(`${origin}/some/where/`);
  await page.locator("#stage:not([hidden])").waitFor();
  console.log(`first picture after ${Math.round(performance.now() - began)} ms`);
  if ((await page.title()) !== "It") throw new Error(`the title is ${await page.title()}`);
  for (const picture of pictures) {
    await page.getByRole("combobox").selectOption(basename(picture));
    await page.waitForFunction(() => document.querySelector("#stage").ariaBusy === "false");
    const theirs = join(work, "composite.png"),
      ours = join(work, "page.png");
    const behind = monitors_of(matte).flatMap(({ name }) => ["--background", `${name}=${picture}`]);
    const crop = `${shown.width_px}x${shown.height_px}+${shown.x_px}+${shown.y_px}`;
    run("composite", matte, "--fill", ...behind, "--crop", crop, "-o", theirs);
    await page.addStyleTag({ content: "#controls { opacity: 0 !important; transition: none }" });
    await page.screenshot({ path: ours });
    const { mean, most, psnr_db } = await difference(page, ours, theirs);
    console.log(`${basename(picture).padEnd(20)} mean ${mean.toFixed(2)}, largest ${most}, of 255; ${psnr_db.toFixed(1)} dB`);
    failed ||= !(mean <= kMaxMean);
  }
} finally {
  await browser.close();
  server.close();
  rmSync(work, { recursive: true });
}
process.exit(failed ? 1 : 0);
