// Answers as the page shows them.

// Control characters but tabs and line breaks, and what turns the direction of writing.
const kUnprintable = /[\u0000-\u0008\u000b-\u001f\u007f-\u009f\u2028-\u202e\u2066-\u2069]/g;
const escaped = (character: string): string => `\\u${character.charCodeAt(0).toString(16).padStart(4, "0")}`;

/** JSON.parse() of an answer. Characters of its texts that would change how others are shown are escaped: U+202E becomes "\u202e". */
export const parsed = (json: string): unknown =>
  JSON.parse(json, (_, value: unknown) => (typeof value === "string" ? value.replace(kUnprintable, escaped) : value));
