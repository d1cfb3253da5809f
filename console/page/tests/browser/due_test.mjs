// The picture that a tethered camera has to take, on the page of the session that is captured: which one, how long the folder has
// waited for it, what is wrong, and the next one once it has arrived. Nothing of it with a camera that streams.
//
//   GLASSWING_CONSOLE_FILES=console/page/dist node tests/browser/due_test.mjs
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

const kAddress = "127.0.0.1:7442";
const captured = (name) => ({
  name,
  state: "SESSION_STATE_CAPTURING",
  created: "2026-11-22T12:00:00Z",
  archiveAddress: kAddress,
  stepCount: 320,
  provenCount: 16,
  plan: {},
});
async function* watched(name) {
  yield { session: captured(name) };
  await new Promise(() => undefined);
}
let camera;
let nodes = [{ name: "eye", address: kAddress }];
let asked = 0;
const server = await stand_in({
  answer: (path, body) => {
    if (path.endsWith("/ListNodes")) return { nodes };
    if (path.endsWith("/GetSession")) return { session: captured(body.name) };
    if (path === "/api/nodes/eye/CameraService/GetCamera") return (++asked, camera);
    return undefined;
  },
  stream: (path) => (path.endsWith("/WatchSession") ? watched("vase") : undefined),
});
const browser = await open_browser();
try {
  const due = (number, waited_s, more = {}) => ({
    onDemand: true,
    due: { what: `picture ${number} of 320`, waitedNs: `${waited_s}500000000`, byHand: true, ...more },
  });
  camera = due(17, 40, { problem: "DSC_0042.NEF: it is damaged, or truncated" });
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  await page.goto(`${server.url}/#/session/vase`);
  const card = page.getByRole("region", { name: "Press the camera's button" });
  const number = card.locator(".due");
  await number.filter({ hasText: /^picture 17 of 320$/ }).waitFor();
  await card.getByText("The folder has waited 40 s.").waitFor();
  await card.getByText("DSC_0042.NEF: it is damaged, or truncated").waitFor();
  // Larger than any other text of the page: it is read from where the camera stands.
  const largest = await page.evaluate(() => {
    const size = (element) => parseFloat(getComputedStyle(element).fontSize);
    return size(document.querySelector(".due")) > 1.5 * Math.max(...[...document.querySelectorAll("h1, h2")].map(size));
  });
  assert.ok(largest);
  await page.evaluate(axe.source);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document.querySelector(".picture-due")));
  assert.deepEqual(violations.map(({ id }) => id), []);
  if (pictures) await page.screenshot({ path: join(pictures, "due.png") });

  // It arrives, and the next one is due.
  camera = due(18, 0);
  await number.filter({ hasText: /^picture 18 of 320$/ }).waitFor();
  assert.equal(await card.getByText("damaged").count(), 0);
  // The node is restarted: it is away for a while, then known again.
  nodes = [];
  await card.waitFor({ state: "detached" });
  nodes = [{ name: "eye", address: kAddress }];
  camera = due(18, 2, { byHand: false });
  await page.getByRole("region", { name: "The camera takes a picture" }).waitFor();

  // Between two pictures, and with a camera that streams, nothing is due; the latter is not asked again.
  camera = { onDemand: true };
  await page.locator(".picture-due").waitFor({ state: "detached" });
  camera = { onDemand: false };
  const before = asked;
  while (asked === before) await page.waitForTimeout(50);
  const last = asked;
  await page.waitForTimeout(2500); // twice as long as it takes to look again
  assert.equal(asked, last);
  assert.deepEqual(errors, []);
} finally {
  await browser.close();
  server.close();
}
