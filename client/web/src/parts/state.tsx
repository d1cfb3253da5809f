/** A state as a word with a dot of its colour. */
export function State({
  kind,
  children,
}: {
  kind: "good" | "caution" | "bad" | "faint" | "busy";
  children: string;
}) {
  return <span class={`state ${kind}`}>{children}</span>;
}
