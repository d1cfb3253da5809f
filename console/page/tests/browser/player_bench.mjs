// How long the player takes for a large matte, with server, console and Chromium without a graphics processor on this machine:
//
//   node tests/browser/player_bench.mjs MATTE.exr
//
// GLASSWING_BIN and GLASSWING_CONSOLE_FILES as in rig.mjs. MATTE.exr takes the place of a small session's. Prints rows of
// docs/goals.md: seconds from the page's address to its first picture, and to as much as a page shows.
import { copyFileSync } from "node:fs";
import { open_browser } from "./browser.mjs";
import { start_rig } from "./rig.mjs";

const kPatience_ms = 300_000;

const [matte] = process.argv.slice(2);
if (matte === undefined) {
  console.error("usage: player_bench.mjs MATTE.exr");
  process.exit(2);
}
const rig = await start_rig();
const browser = await open_browser();
try {
  rig.glasswing("capture", rig.plan("quick"), "--session", "it", "--watch");
  rig.glasswing("solve", "it", "--watch");
  copyFileSync(matte, rig.matte("it"));
  const page = await browser.newPage({ viewport: { width: 1400, height: 1000 } });
  await page.goto(rig.glasswing("console", "token").match(/http\S+/)[0]);
  await page.getByRole("link", { name: "Play" }).waitFor();
  const row = (name, began) =>
    console.log(JSON.stringify({ name, value: (performance.now() - began) / 1000, unit: "s" }));
  const began = performance.now();
  await page.goto(`${rig.url}#/play/it`);
  await page.getByRole("button", { name: "Download frame" }).waitFor({ timeout: kPatience_ms });
  row("player, 12 megapixels: first picture", began);
  await page
    .getByRole("progressbar", { name: "Loading the matte" })
    .waitFor({ state: "detached", timeout: kPatience_ms });
  row("player, 12 megapixels: as much as a page shows", began);
} finally {
  await browser.close();
  rig.down();
}
