// The theme: light, dark, or the system's.
import { effect, signal } from "@preact/signals";

const kThemes = ["system", "light", "dark"] as const;
export type Theme = (typeof kThemes)[number];

const kept = localStorage.getItem("theme");
export const theme = signal<Theme>(kThemes.find((each) => each === kept) ?? "system");

effect(() => {
  document.documentElement.dataset["theme"] = theme.value;
  localStorage.setItem("theme", theme.value);
});

export function nextTheme(): void {
  theme.value = kThemes[(kThemes.indexOf(theme.value) + 1) % kThemes.length]!;
}
