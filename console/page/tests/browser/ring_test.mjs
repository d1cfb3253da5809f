// The ring of a turntable series' poses on a session's page: captured, running and flagged ones, and a pose captured while the
// page is open.
//
//   GLASSWING_CONSOLE_FILES=console/page/dist node tests/browser/ring_test.mjs
//
// GLASSWING_PICTURES names a directory for a picture.
import { strict as assert } from "node:assert";
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import axe from "axe-core";
import { open_browser } from "./browser.mjs";
import { stand_in } from "./stand_in.mjs";

const pictures = process.env.GLASSWING_PICTURES;
if (pictures) mkdirSync(pictures, { recursive: true });

const kCount = 36;
const pose = (number, more = {}) => ({
  name: `vase-${String(10 * number).padStart(3, "0")}`,
  note: `turn at ${10 * number} deg, pose ${number + 1} of ${kCount}`,
  tags: ["vase"],
  axes: { turn: 10 * number },
  state: "SESSION_STATE_DONE",
  method: "gaussian",
  created: "2026-11-22T12:00:00Z",
  stepCount: 5,
  provenCount: 5,
  plan: {},
  ...more,
});
const sessions = Array.from({ length: 20 }, (_, number) => pose(number));
sessions[7] = pose(7, { state: "SESSION_STATE_FAILED", provenCount: 3, reason: "step 3 has no proof" });
sessions.push(pose(20, { state: "SESSION_STATE_CAPTURING", provenCount: 2 }));

const named = (name) => ({ session: sessions.find((session) => session.name === name) });
async function* watched(name) {
  yield named(name);
  await new Promise(() => undefined);
}
let opened = "vase-000";
const asked = [];
const server = await stand_in({
  answer: (path, body) => {
    if (path.endsWith("/ListSessions")) {
      asked.push(body.tags);
      return { sessions: sessions.filter((session) => !body.tags || body.tags.every((tag) => session.tags.includes(tag))) };
    }
    return path.endsWith("/GetSession") ? named(body.name) : undefined;
  },
  stream: (path) => (path.endsWith("/WatchSession") ? watched(opened) : undefined),
});
const browser = await open_browser();
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  await page.goto(`${server.url}/#/session/${opened}`);
  const ring = page.getByRole("group", { name: "The poses of vase, seen from above" });
  await ring.waitFor();
  const count = (state) => ring.locator(`circle.${state}`).count();
  await page.getByText("19 of 36 captured, 1 running, 1 flagged").waitFor();
  assert.deepEqual([await count("captured"), await count("running"), await count("flagged")], [19, 1, 1]);
  assert.deepEqual(asked.at(-1), ["vase"]);

  // Where the table turns them: 0 is below, at the camera, 90 to the left, each a sixth of a radius off at most.
  const middle = async (locator) => {
    const box = await locator.boundingBox();
    return [box.x + box.width / 2, box.y + box.height / 2];
  };
  const [x, y] = await middle(ring.locator("circle.track"));
  const radius = (await ring.locator("circle.track").boundingBox()).width / 2;
  for (const [name, dx, dy] of [["vase-000", 0, 1], ["vase-090", -1, 0], ["vase-180", 0, -1]]) {
    const [at_x, at_y] = await middle(ring.getByRole("link", { name: new RegExp(`^${name}:`) }).locator("circle"));
    assert.ok(Math.abs(at_x - x - dx * radius) < radius / 6 && Math.abs(at_y - y - dy * radius) < radius / 6, name);
  }
  if (pictures) await page.screenshot({ path: join(pictures, "ring.png") });

  // The next pose is captured while the page is open.
  sessions[20] = pose(20);
  sessions.push(pose(21, { state: "SESSION_STATE_CAPTURING", provenCount: 0 }));
  await page.getByText("20 of 36 captured, 1 running, 1 flagged").waitFor();

  // A dot leads to its session; nothing is wrong for those who cannot see it.
  opened = "vase-070";
  await ring.getByRole("link", { name: "vase-070: 70°, flagged" }).click();
  await page.getByRole("heading", { name: "vase-070" }).waitFor();
  await page.getByText("step 3 has no proof").first().waitFor();
  await page.addScriptTag({ content: axe.source }).catch(() => page.evaluate(axe.source));
  const { violations } = await page.evaluate(() => globalThis.axe.run(document.querySelector(".pose-ring")));
  assert.deepEqual(violations.filter(({ impact }) => impact === "serious" || impact === "critical").map(({ id }) => id), []);

  // A session of no series has no ring.
  sessions.push({ ...pose(0), name: "alone", note: "", tags: [] });
  opened = "alone";
  await page.evaluate(() => (location.hash = "#/session/alone"));
  await page.getByRole("heading", { name: "alone" }).waitFor();
  assert.equal(await page.locator(".pose-ring").count(), 0);
  assert.deepEqual(errors, []);
} finally {
  await browser.close();
  server.close();
}
