// A new session's form, against a fake server. Its cameras: all that are up at first, and what is ticked is what the server
// gets; the last one cannot be left out. How it adapts, and what the session's page says of the rounds.
//
//   GLASSWING_CONSOLE_FILES=console/page/dist node tests/browser/new_session_test.mjs
import { strict as assert } from "node:assert";
import axe from "axe-core";
import { open_browser } from "./browser.mjs";
import { stand_in } from "./stand_in.mjs";

const camera = (name, up = true) => ({ kind: "NODE_KIND_CAMERA", name, up });
const estimated = []; // plans
let made, created, queued;
const session = {
  name: "vase",
  state: "SESSION_STATE_CAPTURING",
  plan: {},
  adapted: [
    { imageCount: 50, knownShare: 0.125, errorDb: 31.25 },
    { imageCount: 100, knownShare: 0.5, errorDb: 38, anyShape: { share: 0.31, knownShare: 0.25, errorDb: 36.5 } },
  ],
};
async function* watched() {
  yield { session };
  await new Promise(() => undefined); // nothing changes
}
const server = await stand_in({
  stream: (path) => (path.endsWith("/WatchSession") ? watched() : undefined),
  answer: (path, body) => {
    if (path.endsWith("/GetSession")) return { session };
    if (path.endsWith("/ListNodes")) return { nodes: [camera("left"), camera("right"), camera("attic", false)] };
    if (path.endsWith("/MakePlan")) {
      made = body;
      return { plan: { monitors: [{ name: "back" }] }, text: 'method: "gaussian"' };
    }
    if (path === "/plans") return { method: "gaussian" };
    if (path.endsWith("/EstimateSession")) {
      estimated.push(body.plan);
      const cameras = (body.plan.cameras ?? []).map((name) => ({ name, widthPx: 640, heightPx: 480 }));
      return { stepCount: 9, seconds: 1, bytes: "1000", freeBytes: "100000", monitors: [], cameras };
    }
    if (path.endsWith("/AddQueueItem")) {
      queued = body.wish.plan;
      return { item: { number: 1 } };
    }
    if (path.endsWith("/CreateSession")) {
      created = body.plan;
      return { session: { name: "vase" } };
    }
    return undefined;
  },
});
const browser = await open_browser();
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  const errors = [];
  page.on("pageerror", (error) => errors.push(error.message));
  await page.goto(`${server.url}/#/session/+new`);
  const cameras = page.getByRole("group", { name: "Cameras" });
  const box = (name) => cameras.getByRole("checkbox", { name });
  await cameras.waitFor();
  assert.equal(await cameras.getByRole("checkbox").count(), 2, "the one that is not up is not offered");
  assert.ok((await box("left").isChecked()) && (await box("right").isChecked()));
  await page.getByText("left 640×480; right 640×480").waitFor();
  assert.equal(made.camera, "left");
  assert.ok(estimated.every((plan) => plan.cameras.join() === "left,right"), "also to see how the ready plans fit");
  await page.evaluate(axe.source);
  const { violations } = await page.evaluate(() => axe.run("form"));
  assert.deepEqual(violations.filter(({ impact }) => impact === "serious" || impact === "critical"), []);

  await box("left").uncheck();
  await box("right").and(page.locator(":disabled")).waitFor();
  await page.getByText("left 640×480").waitFor({ state: "detached" });
  const anyShape = page.getByRole("checkbox", { name: "Also of footprints of any shape" });
  assert.equal(await anyShape.count(), 0, "only what adapts asks for them");
  await page.getByRole("checkbox", { name: "Show further images" }).check();
  await anyShape.check();
  await page.getByRole("button", { name: "Start" }).click();
  await page.waitForFunction(() => location.hash === "#/session/vase");
  assert.deepEqual(created, { method: "gaussian", camera: "right", adapt: { footprints: "any" } });
  assert.equal(made.camera, "right");

  await page.getByText("31 % of the object 25 % of these known; 95 % to 36.5 dB").waitFor();
  await page.getByText("What each round found").click();
  const rounds = page.getByRole("region", { name: "What each round found" }).getByRole("row");
  assert.deepEqual((await rounds.allInnerTexts()).slice(1).map((text) => text.split("\t")), [
    ["50", "12 %", "31.3 dB", "0 %", "", ""],
    ["100", "50 %", "38.0 dB", "31 %", "25 %", "36.5 dB"],
  ]);

  await page.goto(`${server.url}/#/session/+new`);
  await page.getByText("left 640×480; right 640×480").waitFor();
  await page.getByRole("checkbox", { name: "Show further images" }).check();
  await page.getByRole("button", { name: "Add to the queue" }).click();
  await page.waitForFunction(() => location.hash === "#/queue");
  assert.deepEqual(queued.adapt, {});
  assert.deepEqual(errors, []);
} finally {
  await browser.close();
  server.close();
}
