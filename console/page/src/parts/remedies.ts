// The commands of `glasswing` that the server's messages quote, and what the console offers in their place.

/** A call for operators. */
export interface Call {
  label: string;
  method: string;
  request: object;
  /** What is lost by it, to be confirmed first. Undefined: nothing. */
  loss?: string;
}

/** A page of the console. */
export interface Place {
  label: string;
  hash: string;
}

/** A part of a message: its text, and what the console offers if that is a command. */
export interface Part {
  text: string;
  isCommand: boolean;
  call?: Call;
  place?: Place;
}

const kSessionCalls: Record<string, [verb: string, method: string]> = {
  resume: ["Resume", "ResumeSession"],
  retry: ["Retry", "ResumeSession"],
  cancel: ["Cancel", "CancelSession"],
  solve: ["Solve", "SolveSession"],
};
const kPlaces: Record<string, Place> = {
  sessions: { label: "Sessions", hash: "#/session" },
  nodes: { label: "Rig", hash: "#/rig" },
  doctor: { label: "Check the rig", hash: "#/rig/check" },
  fleet: { label: "Fleet", hash: "#/fleet" },
  hold: { label: "Rig", hash: "#/rig" },
};

const calibrations = (label: string): { place: Place } => ({ place: { label, hash: "#/calibrations" } });

type Offer = Pick<Part, "call" | "place">;

const kName = "([A-Za-z0-9._-]*[A-Za-z0-9_-])";
/** Each form of a command, and the offer for its arguments. The first form that fits counts. */
const kForms: [RegExp, (...words: string[]) => Offer][] = [
  [
    new RegExp(`^(resume|retry|cancel|solve) ${kName}(?: --watch)?`),
    (verb, name) => {
      const [label, method] = kSessionCalls[verb!]!;
      return { call: { label: `${label} ${name}`, method: `SessionService/${method}`, request: { name } } };
    },
  ],
  [
    new RegExp(`^delete ${kName}`),
    (name) => ({
      call: {
        label: `Delete ${name}`,
        method: "SessionService/DeleteSession",
        request: { name },
        loss: "Its frames and mattes are removed for good.",
      },
    }),
  ],
  [
    new RegExp(`^nodes release (?!NAME)${kName}`), // capitals stand for any name
    (name) => ({
      call: {
        label: `Release ${name}`,
        method: "NodeService/ReleaseNode",
        request: { name },
        loss: "The server forgets this node, and another one may take its name.",
      },
    }),
  ],
  [
    new RegExp(`^calibrate forget ${kName}`),
    (device) => ({
      call: {
        label: `Forget the calibration of ${device}`,
        method: "RigService/ForgetCalibration",
        request: { device },
        loss: "Later sessions do without this calibration.",
      },
    }),
  ],
  [/^calibrate camera/, () => calibrations("Calibrate the camera")],
  [
    new RegExp(`^calibrate sync(?: --monitor ${kName})?`),
    (monitor) => calibrations(monitor ? `Measure the timing of ${monitor}` : "Measure the monitors' timing"),
  ],
  [/^preview --pattern lines/, () => ({ place: { label: "Test pattern", hash: "#/rig/pattern" } })],
  [
    new RegExp(`^calibrate display(?: --monitor ${kName})?`),
    (monitor) => calibrations(monitor ? `Calibrate ${monitor}` : "Calibrate the monitors"),
  ],
  [/^calibrate(?: list)?/, () => calibrations("Calibrations")],
  [/^(sessions|nodes|doctor|fleet|hold)(?: --state damaged| release NAME)?/, (page) => ({ place: kPlaces[page!]! })],
];

function commandAt(text: string): Part {
  const words = text.replace(/^`?glasswing /, "");
  for (const [form, offer] of kForms) {
    const found = form.exec(words);
    if (!found) continue;
    const quoted = text.startsWith("`");
    const command = `glasswing ${found[0]}`;
    if (quoted && text[command.length + 1] !== "`") continue;
    return { text: command, isCommand: true, ...offer(...found.slice(1)) };
  }
  const quoted = /^`([^`]*)`/.exec(text);
  return quoted ? { text: quoted[1]!, isCommand: true } : { text: "glasswing ", isCommand: false };
}

/** Splits a message at the commands in it; the parts' texts are the message without backquotes. */
export function partsOf(message: string): Part[] {
  const parts: Part[] = [];
  const say = (text: string): void => {
    const last = parts.at(-1);
    if (last && !last.isCommand) last.text += text;
    else if (text) parts.push({ text, isCommand: false });
  };
  let rest = message;
  for (let at = rest.search(/`?\bglasswing /); at >= 0; at = rest.search(/`?\bglasswing /)) {
    say(rest.slice(0, at));
    const part = commandAt(rest.slice(at));
    if (part.isCommand) parts.push(part);
    else say(part.text);
    const quotes = part.isCommand && rest[at] === "`" ? 2 : 0;
    rest = rest.slice(at + part.text.length + quotes);
  }
  say(rest);
  return parts;
}
