// A job with the mouse alone, from the login's link to a downloaded composite, on its own rig; counts the clicks:
//
//   GLASSWING_BIN=build/release/bin GLASSWING_CONSOLE_FILES=console/page/dist node tests/browser/mouse_test.mjs
//
// Every click is a press of the mouse on what a visitor sees; nothing is typed, and no address is entered but the link. Fails
// beyond kMaxClicks. GLASSWING_PICTURES names a directory for a picture before each click.
import { strict as assert } from "node:assert";
import { mkdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { open_browser } from "./browser.mjs";
import { start_rig } from "./rig.mjs";

const kPatience_ms = 240_000; // a capture and a solve on a busy machine
const kMaxClicks = 12;

const pictures = process.env.GLASSWING_PICTURES;
if (pictures) mkdirSync(pictures, { recursive: true });

const rig = await start_rig();
const browser = await open_browser();
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(kPatience_ms);
  await page.goto(rig.glasswing("console", "token", "--name", "anna").trim());

  const clicks = [];
  /** Where its middle is, once it can be clicked. */
  const middle_of = async (target) => {
    await target.click({ trial: true });
    const { x, y, width, height } = await target.boundingBox();
    return [x + width / 2, y + height / 2];
  };
  const click = async (role, name) => {
    const middle = await middle_of(page.getByRole(role, { name, exact: true }));
    clicks.push(name);
    if (pictures) await page.screenshot({ path: join(pictures, `mouse-${clicks.length}.png`) });
    await page.mouse.click(...middle);
  };

  await click("link", "Sessions");
  await click("link", "New session");
  await click("button", "Start");
  await page.locator(".session .row .state", { hasText: /^done$/ }).waitFor();
  await click("link", "Try backgrounds");
  const stage = page.getByRole("application");
  const [x, y] = await middle_of(stage);
  const still = await stage.screenshot();
  clicks.push("drag");
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 120, y + 40, { steps: 8 });
  await page.mouse.up();
  await page.waitForFunction(() => document.querySelector("canvas.stage").ariaBusy === "false");
  assert.ok(!still.equals(await stage.screenshot()), "the picture did not move");
  const [download] = await Promise.all([page.waitForEvent("download"), click("button", "Download frame")]);

  // The picture on the stage, without the id patch: what the camera sees of the monitor's 128x96 px.
  const composite = readFileSync(await download.path());
  assert.equal(composite.toString("latin1", 1, 4), "PNG");
  assert.deepEqual([composite.readUInt32BE(16), composite.readUInt32BE(20)], [128, 96]);
  const [name] = JSON.parse(rig.glasswing("--json", "sessions")).sessions.map((session) => session.name);
  assert.equal(download.suggestedFilename(), `${name}.png`);
  console.log(`from the login to a composite: ${clicks.length} clicks: ${clicks.join(", ")}`);
  console.log(JSON.stringify({ name: "console: clicks from login to a composite", value: clicks.length, unit: "" }));
  assert.ok(clicks.length <= kMaxClicks, `${clicks.length} clicks; ${kMaxClicks} are allowed`);
} finally {
  await browser.close();
  rig.down();
}
