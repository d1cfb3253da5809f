import axe from "axe-core";

const kMinText_px = 12;

/** As Lighthouse looks at a page on a phone: what is too small to read or to touch, and pictures that move others as they load. */
export async function phone_faults(page) {
  await page.evaluate(axe.source);
  return page.evaluate(async (min_text_px) => {
    const { violations } = await window.axe.run({
      runOnly: ["target-size", "color-contrast", "label", "button-name", "link-name", "image-alt", "meta-viewport"],
    });
    const faults = violations.map(({ id, nodes }) => `${id} at ${nodes.map(({ target }) => target).join(", ")}`);
    if (!/width=device-width/.test(document.querySelector("meta[name=viewport]")?.content))
      faults.push("no viewport of the device's width");
    const wide = document.documentElement.scrollWidth;
    if (wide > innerWidth) faults.push(`${wide} px wide on a screen of ${innerWidth}`);
    const named = (element) => `${element.localName}.${element.getAttribute("class") ?? ""}`;
    const is_seen = (element) => element.checkVisibility({ opacityProperty: true, visibilityProperty: true });
    const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    const small = new Set();
    while (texts.nextNode()) {
      const { parentElement: element, textContent } = texts.currentNode;
      if (textContent.trim() === "" || !is_seen(element)) continue;
      const scale = element instanceof SVGGraphicsElement ? element.getScreenCTM().a : 1;
      const size_px = scale * parseFloat(getComputedStyle(element).fontSize);
      if (size_px < min_text_px) small.add(`text of ${size_px.toFixed(1)} px in ${named(element)}`);
    }
    faults.push(...small);
    for (const image of document.images)
      if (is_seen(image) && getComputedStyle(image).aspectRatio === "auto")
        faults.push(`${named(image)} ${image.alt} has no size before it is loaded`);
    return faults;
  }, kMinText_px);
}
