// How things are written on the page.

const STATES = {
  "-2": ["away", "unreachable"], "-1": ["off", "no supply"], 0: ["booting", "booting"], 1: ["S1 inhibited", "switching-on inhibited"], 2: ["S2 ready", "ready to switch on"],
  3: ["S3 on", "switched on"], 4: ["S4 operation", "operation"], 5: ["S5 stopping", "switching off"],
};

/** Class, short and long word for a drive's state; a fault is shown before the state. */
export function stateOf(drive) {
  const [short, long] = STATES[drive.state] || ["?", "unknown"];
  if (drive.state === -2) return {kind: "off", short, long: drive.unreachable ? `unreachable: ${drive.unreachable.reason}` : long};
  if (drive.state === -1) return {kind: "off", short, long};
  if (drive.fault) return {kind: "fault", short: `${short.split(" ")[0]} fault`, long: `fault, ${long}`};
  if (drive.state === 4) return {kind: "run", short, long};
  return {kind: drive.state === 0 ? "off" : "idle", short, long};
}

/** Who controls a drive: its name, or its address where the bus gives it none. */
export const controllerOf = drive => /^0x/.test(drive.controller || "") && drive.controller_ip || drive.controller || "";

export const number = (value, digits = 1) =>
  value === null || value === undefined ? "–" : (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits);

/** A time with a unit that fits. */
export function time(seconds) {
  if (seconds === null || seconds === undefined) return "–";
  const size = Math.abs(seconds);
  if (size === 0) return "0 s";
  if (size < 1e-3) return `${+(seconds * 1e6).toPrecision(3)} µs`;
  if (size < 1) return `${+(seconds * 1e3).toPrecision(3)} ms`;
  if (size < 120) return `${+seconds.toPrecision(3)} s`;
  if (size < 7200) return `${Math.round(seconds / 60)} min`;
  return `${(seconds / 3600).toFixed(1)} h`;
}

export const hex = value => `0x${(value >>> 0).toString(16).toUpperCase().padStart(4, "0")}`;
export const clock = seconds => new Date(seconds * 1000).toLocaleTimeString([], {hourCycle: "h23"});
export const plural = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;
