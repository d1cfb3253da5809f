import { useEffect, useState } from "preact/hooks";

const resolved = new Map<string, string>();
const dark = matchMedia("(prefers-color-scheme: dark)");

/** The present value of a colour of style.css, for canvases: "rgb(29, 122, 58)" for "--good". */
export function colourOf(token: string): string {
  const key = `${isDark()}${token}`;
  let colour = resolved.get(key);
  if (colour === undefined) {
    const probe = document.createElement("span");
    probe.style.color = `var(${token})`;
    document.body.append(probe);
    colour = getComputedStyle(probe).color;
    probe.remove();
    resolved.set(key, colour);
  }
  return colour;
}

function isDark(): boolean {
  const chosen = document.documentElement.dataset["theme"];
  return chosen === "dark" || (chosen !== "light" && dark.matches);
}

/** True if the page is dark. Drawings that use colourOf() must be redrawn when it changes. */
export function useDark(): boolean {
  const [now, setNow] = useState(isDark());
  useEffect(() => {
    const look = (): void => setNow(isDark());
    const attribute = new MutationObserver(look);
    attribute.observe(document.documentElement, { attributeFilter: ["data-theme"] });
    dark.addEventListener("change", look);
    return () => (attribute.disconnect(), dark.removeEventListener("change", look));
  }, []);
  return now;
}
