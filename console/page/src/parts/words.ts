// Formats quantities and errors for people.

export const errorText = (error: unknown): string => (error instanceof Error ? error.message : String(error));

export function bytesText(bytes: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  for (; bytes >= 1000 && unit < units.length - 1; ++unit) bytes /= 1000;
  return `${bytes.toLocaleString("en", { maximumSignificantDigits: bytes >= 100 ? 3 : 2 })} ${units[unit]}`;
}

export function secondsText(seconds: number): string {
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  const whole = Math.round(seconds);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${String(whole % 60).padStart(2, "0")} s`;
  return `${Math.floor(whole / 3600)} h ${String(Math.floor((whole % 3600) / 60)).padStart(2, "0")} min`;
}

export function nanosecondsText(ns: number): string {
  const units = ["ns", "µs", "ms", "s"];
  let unit = 0;
  for (; Math.abs(ns) >= 1000 && unit < units.length - 1; ++unit) ns /= 1000;
  return `${Number(ns.toPrecision(3))} ${units[unit]}`;
}

export function countText(count: number, one: string, many = `${one}s`): string {
  return `${count.toLocaleString("en")} ${count === 1 ? one : many}`;
}

/** An RFC 3339 time in local time, with the date unless it is today. */
export function timeText(rfc3339: string, now = new Date()): string {
  const time = new Date(rfc3339);
  if (Number.isNaN(time.getTime())) return rfc3339;
  const hour = time.toLocaleTimeString(undefined, { hour: "2-digit", minute: "2-digit" });
  return time.toDateString() === now.toDateString()
    ? hour
    : `${time.toLocaleDateString(undefined, { day: "numeric", month: "short", year: "numeric" })}, ${hour}`;
}

/** "capturing" for "SESSION_STATE_CAPTURING" with the prefix "SESSION_STATE_". */
export function plainName(value: string | undefined, prefix: string): string {
  return (value ?? "").replace(prefix, "").toLowerCase().replaceAll("_", " ") || "unknown";
}
