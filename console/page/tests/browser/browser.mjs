import { readFileSync } from "node:fs";
import { basename } from "node:path";
import { chromium } from "playwright-core";

/** Debian's Chromium, headless, with WebGL 2 in software. GLASSWING_CHROMIUM names another. */
export function open_browser() {
  return chromium.launch({
    executablePath: process.env.GLASSWING_CHROMIUM ?? "/usr/bin/chromium",
    args: [
      "--no-sandbox",
      "--no-first-run",
      "--disable-quic",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      "--use-gl=angle",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
    ],
  });
}

/** Drops a file on an element. */
export async function drop_file(element, file) {
  const data = await element.page().evaluateHandle(
    ([text, name]) => {
      const transfer = new DataTransfer();
      transfer.items.add(new File([Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0))], name));
      return transfer;
    },
    [readFileSync(file).toString("base64"), basename(file)],
  );
  await element.dispatchEvent("drop", { dataTransfer: data });
}
