// The queue's page, on its own rig: items are dragged, moved by their buttons, approved, and run to their end.
//
//   GLASSWING_BIN=build/release/bin GLASSWING_CONSOLE_FILES=console/page/dist node tests/browser/queue_test.mjs
//
// GLASSWING_PICTURES names a directory for a picture.
import { strict as assert } from "node:assert";
import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { open_browser } from "./browser.mjs";
import { start_rig } from "./rig.mjs";

const pictures = process.env.GLASSWING_PICTURES;
if (pictures) mkdirSync(pictures, { recursive: true });

const rig = await start_rig();
const browser = await open_browser();
try {
  const add = (session, ...options) => rig.glasswing("queue", "add", rig.plan("quick"), "--session", session, ...options);
  add("first");
  add("second");
  add("third", "--approval");
  add("fourth");
  const order = () =>
    JSON.parse(rig.glasswing("--json", "queue", "list")).items.map((item) => item.wish.session).join(" ");
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(120_000);
  await page.goto(rig.glasswing("console", "token", "--name", "anna").trim());
  await page.getByRole("link", { name: "Queue", exact: true }).click();
  const item = (session) => page.locator(".item", { hasText: session });
  const shows = (...sessions) =>
    page.waitForFunction(
      (wanted) => [...document.querySelectorAll(".item b")].map((name) => name.textContent).join(" ") === wanted,
      sessions.join(" "),
    );

  await shows("first", "second", "third", "fourth");
  await item("fourth").dragTo(item("second"));
  await shows("first", "fourth", "second", "third");
  assert.equal(order(), "first fourth second third");
  await page.getByRole("button", { name: "Move third up" }).click();
  await shows("first", "fourth", "third", "second");
  await item("second").getByRole("button", { name: "Remove" }).click();
  await shows("first", "fourth", "third");
  assert.equal(order(), "first fourth third");
  if (pictures) await page.screenshot({ path: join(pictures, "queue.png") });

  await page.getByRole("button", { name: "Start" }).click();
  const state = (session, word) => item(session).locator(".state", { hasText: word }).waitFor();
  await state("first", "done");
  await state("fourth", "done");
  await item("third").getByText("waits for an approval").waitFor();
  await item("third").getByRole("button", { name: "Approve" }).click();
  await state("third", "done");
  await page.getByRole("button", { name: "Pause after this item" }).click();
  await page.getByRole("button", { name: "Start" }).waitFor();
  assert.match(rig.glasswing("queue", "history", "--item", "3", "--tsv"), /anna.*approved/);
  if (pictures) await page.screenshot({ path: join(pictures, "queue-done.png") });
} finally {
  await browser.close();
  rig.down();
}
