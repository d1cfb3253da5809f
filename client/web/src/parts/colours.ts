import { useEffect, useState } from "preact/hooks";

const resolved = new Map<string, string>();
const dark = matchMedia("(prefers-color-scheme: dark)");

/** What a colour of style.css is now, for canvases: "rgb(29, 122, 58)" of "--good". */
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

/** Whether the page is dark: drawings that use colourOf() are made anew when it changes. */
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
