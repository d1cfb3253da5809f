// The state of each step of a capture, collected from its events. Stored as columns of numbers, so that tens of thousands of
// events are cheap to keep and to draw.
import type { StepEventJson } from "../gen/glasswing/v1/session_service_pb";

/** States of a step, ascending; a column of several steps shows the lowest. */
export const kStates = ["lost", "planned", "shown", "imported", "time", "patch"] as const;
export type StepState = (typeof kStates)[number];
const kLost = 0,
  kPlanned = 1,
  kShown = 2,
  kImported = 3,
  kTime = 4,
  kPatch = 5;
const isProven = (state: number): boolean => state >= kImported;

/** An event's kind is a state's index, or this. */
export const kRetaken = kStates.length;

export interface Retake {
  step: number;
  seconds: number;
  why: string;
}

const kMaxRetakes = 100; // the newest, kept with their reasons

/** A growing array of numbers. */
class Column<T extends Float64Array | Int32Array | Uint8Array> {
  length = 0;
  constructor(private numbers: T) {}
  push(number: number): void {
    if (this.length === this.numbers.length) {
      const wider = new (this.numbers.constructor as new (length: number) => T)(2 * this.length);
      wider.set(this.numbers as never);
      this.numbers = wider;
    }
    this.numbers[this.length++] = number;
  }
  all(): T {
    return this.numbers.subarray(0, this.length) as T;
  }
}

export class Timeline {
  /** For each step: an index into kStates, and the number of retakes. */
  readonly states: Uint8Array;
  readonly retakeCounts: Uint16Array;
  /** Number of steps in each of kStates. */
  readonly counts = new Array<number>(kStates.length).fill(0);
  retaken = 0;
  /** Time of the latest event. */
  seconds = 0;
  /** Newest first. */
  readonly retakes: Retake[] = [];
  /** Number of retakes by reason. */
  readonly reasons = new Map<string, number>();
  private readonly eventSeconds = new Column(new Float64Array(1024));
  private readonly eventSteps = new Column(new Int32Array(1024));
  private readonly eventKinds = new Column(new Uint8Array(1024));
  private readonly provenSeconds = new Column(new Float64Array(1024));

  constructor(readonly stepCount: number) {
    this.states = new Uint8Array(stepCount).fill(kPlanned);
    this.retakeCounts = new Uint16Array(stepCount);
    this.counts[kPlanned] = stepCount;
  }

  get events(): { seconds: Float64Array; steps: Int32Array; kinds: Uint8Array } {
    return { seconds: this.eventSeconds.all(), steps: this.eventSteps.all(), kinds: this.eventKinds.all() };
  }

  /** When steps were proven, in the order of events. */
  get provenAt(): Float64Array {
    return this.provenSeconds.all();
  }

  add(events: readonly StepEventJson[]): void {
    for (const event of events) {
      const step = event.step ?? 0,
        seconds = Number(event.seconds ?? 0);
      if (step < 0 || step >= this.stepCount) continue;
      const kind = event.outcome === "STEP_OUTCOME_RETAKEN" ? kRetaken : stateOf(event);
      if (kind === undefined) continue;
      if (kind === kRetaken) this.addRetake({ step, seconds, why: event.why ?? "" });
      else this.move(step, kind);
      if (isProven(kind) && kind !== kRetaken) this.provenSeconds.push(seconds);
      this.seconds = Math.max(this.seconds, seconds);
      this.eventSeconds.push(seconds);
      this.eventSteps.push(step);
      this.eventKinds.push(kind);
    }
  }

  private move(step: number, state: number): void {
    const before = this.states[step]!;
    if (isProven(before) && !isProven(state)) return;
    this.counts[before]!--;
    this.counts[state]!++;
    this.states[step] = state;
  }

  private addRetake(retake: Retake): void {
    ++this.retaken;
    ++this.retakeCounts[retake.step]!;
    this.reasons.set(retake.why, (this.reasons.get(retake.why) ?? 0) + 1);
    this.retakes.unshift(retake);
    if (this.retakes.length > kMaxRetakes) this.retakes.pop();
  }
}

function stateOf({ outcome, proof }: StepEventJson): number | undefined {
  switch (outcome) {
    case "STEP_OUTCOME_SHOWN":
      return kShown;
    case "STEP_OUTCOME_LOST":
      return kLost;
    case "STEP_OUTCOME_PROVEN":
      return proof === "PROOF_TIME_AND_PATCH" ? kPatch : proof === "PROOF_IMPORTED" ? kImported : kTime;
    default:
      return undefined;
  }
}

/** For a strip of `columns` columns: the lowest state of each column's steps, and 1 if any was retaken. */
export function columnsOf(
  { states, retakeCounts, stepCount }: Timeline,
  columns: number,
): { states: Uint8Array; retaken: Uint8Array } {
  const out = { states: new Uint8Array(columns).fill(kStates.length), retaken: new Uint8Array(columns) };
  for (let step = 0; step < stepCount; ++step) {
    const column = Math.floor((step * columns) / stepCount);
    out.states[column] = Math.min(out.states[column]!, states[step]!);
    if (retakeCounts[step]! > 0) out.retaken[column] = 1;
  }
  return out;
}
