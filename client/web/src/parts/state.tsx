/** A state: a coloured dot and a word. */
export function State({
  kind,
  children,
}: {
  kind: "good" | "caution" | "bad" | "faint" | "busy";
  children: string;
}) {
  return <span class={`state ${kind}`}>{children}</span>;
}
