export type StateKind = "good" | "kept" | "busy" | "paused" | "caution" | "bad" | "faint";

// Each kind has a form of its own, so that no state is told by its colour alone. 12 by 12.
const kForms: Record<StateKind, { fill?: string; line?: string }> = {
  good: { line: "M1.5 6.5 4.5 9.5 10.5 2.5" }, // a tick
  kept: { fill: "M1.5 1.5h9v9h-9z" }, // a full square
  busy: { fill: "M6 1a5 5 0 0 1 0 10z", line: "M6 1.2a4.8 4.8 0 1 0 .01 0" }, // half a disc
  paused: { fill: "M2 1.5h3v9H2zM7 1.5h3v9H7z" }, // two bars
  caution: { fill: "M6 .8 11.6 11H.4z" }, // a triangle
  bad: { line: "M2 2l8 8M10 2l-8 8" }, // a cross
  faint: { line: "M6 1.5a4.5 4.5 0 1 0 .01 0" }, // a ring
};

/** A state: a form, a colour and a word. */
export function State({ kind, children }: { kind: StateKind; children: string }) {
  const { fill, line } = kForms[kind];
  return (
    <span class={`state ${kind}`}>
      <svg viewBox="0 0 12 12" aria-hidden="true">
        {fill && <path class="fill" d={fill} />}
        {line && <path class="line" d={line} />}
      </svg>
      {children}
    </span>
  );
}
