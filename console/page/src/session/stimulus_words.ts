import type { FrameJson } from "../gen/glasswing/v1/archive_pb";
import type { StimulusJson } from "../gen/glasswing/v1/stimulus_pb";

const number = (value: number | string | undefined): number => Number(value ?? 0);
const short = (value: number | string | undefined): string => String(Number(number(value).toPrecision(6)));

// The words of core/pattern/describe_step, and the colour of a solid.
function patternWords(stimulus: StimulusJson): string {
  const { kind = "", name = "" } = stimulus;
  switch (kind) {
    case "gauss_stripe":
      return `stripe at ${short(stimulus.phiDeg)} deg, r ${number(stimulus.rPx).toFixed(1)} px`;
    case "sinusoid":
      return `sinusoid at ${short(stimulus.phiDeg)} deg, period ${short(stimulus.periodPx)} px, phase ${short(stimulus.phaseDeg)} deg`;
    case "square":
      return `${stimulus.orient === "vertical_bars" ? "vertical" : "horizontal"} bars of ${short(stimulus.barWidthPx)} px${stimulus.inverse ? ", inverse" : ""}`;
    case "solid":
      return `solid ${colourWords(stimulus.colour ?? [])}`;
    case "patch":
      return "id patch alone";
    default:
      return name ? `${kind} ${name}` : kind;
  }
}

/** Linear r, g, b; an empty colour is white. */
function colourWords(colour: readonly (number | string)[]): string {
  if (colour.length === 0 || colour.every((part) => number(part) === 1)) return "white";
  if (colour.every((part) => number(part) === 0)) return "black";
  return colour.map(short).join(", ");
}

/** "back: stripe at 45 deg, r 120.0 px" */
export function stimulusWords(stimulus: StimulusJson): string {
  return `${stimulus.panel ?? ""}: ${patternWords(stimulus)}`;
}

/** The stimuli of all monitors during the frame's exposure. */
export function shownWords({ stimulus, alsoLit = [] }: FrameJson): string {
  return [...(stimulus ? [stimulus] : []), ...alsoLit].map(stimulusWords).join("; ");
}

export function proofWords(proof: FrameJson["proof"]): string {
  if (proof === "PROOF_TIME_AND_PATCH") return "proven by time and by its id patch";
  if (proof === "PROOF_TIME") return "proven by time alone";
  if (proof === "PROOF_IMPORTED") return "imported, not proven here";
  return "not proven";
}
