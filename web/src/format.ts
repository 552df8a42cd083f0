// Numbers as the page writes them: a real minus sign, fixed digits, an en dash for "not known".

export const UNKNOWN = '–';

export function fixed(value: number | null, digits: number): string {
  if (value === null || !Number.isFinite(value)) return UNKNOWN;
  const written = value.toFixed(digits);
  // −0.000 would flicker between two signs while a robot is at the origin.
  if (Number(written) === 0) return written.replace('-', '');
  return written.replace('-', '−');
}

/** Three significant digits or so, never more decimals than `digits`: 2.13, 21.3, 213. */
export function compact(value: number | null, digits: number): string {
  if (value === null || !Number.isFinite(value)) return UNKNOWN;
  const size = Math.abs(value);
  const decimals = size < 10 ? digits : size < 100 ? Math.min(digits, 1) : 0;
  return fixed(value, decimals);
}

export interface Quantity {
  value: string;
  unit: string;
}

/** 23 ms, 1.4 s, 3 min, 2.0 h. */
export function duration(ms: number | null): Quantity {
  if (ms === null || !Number.isFinite(ms)) return { value: UNKNOWN, unit: '' };
  const size = Math.abs(ms);
  if (size < 999.5) return { value: fixed(ms, 0), unit: 'ms' };
  if (size < 99_950) return { value: fixed(ms / 1e3, size < 9_950 ? 1 : 0), unit: 's' };
  if (size < 3_600_000) return { value: fixed(ms / 60e3, 0), unit: 'min' };
  return { value: fixed(ms / 3600e3, 1), unit: 'h' };
}

/** Like `duration`, with a decimal below ten milliseconds: 7.4 ms, 23 ms, 1.5 s. */
export function latency(ms: number | null): Quantity {
  return ms !== null && Math.abs(ms) < 9.95 ? { value: fixed(ms, 1), unit: 'ms' } : duration(ms);
}

/** −12 µs, 0.31 ms, 23 ms, 30.0 h: clocks of two machines count from their starts. */
export function clockOffset(seconds: number): Quantity {
  const ms = seconds * 1e3;
  if (Math.abs(ms) < 0.0995) return { value: fixed(ms * 1e3, 0), unit: 'µs' };
  return Math.abs(ms) < 9.95 ? { value: fixed(ms, 2), unit: 'ms' } : duration(ms);
}

/** 2.1 mm, 48 mm, 1.25 m: uncertainty grows over three decades when a body coasts. */
export function length(mm: number | null): Quantity {
  if (mm === null || !Number.isFinite(mm)) return { value: UNKNOWN, unit: 'mm' };
  if (Math.abs(mm) >= 999.5) return { value: fixed(mm / 1e3, 2), unit: 'm' };
  return { value: fixed(mm, Math.abs(mm) < 9.95 ? 1 : 0), unit: 'mm' };
}

/** 812, 12.4 k, 3.1 M. */
export function count(value: number): string {
  if (value < 10_000) return String(value);
  if (value < 1e6) return `${fixed(value / 1e3, value < 1e5 ? 1 : 0)} k`;
  return `${fixed(value / 1e6, 1)} M`;
}

const two = (part: number): string => String(part).padStart(2, '0');

export function timeOfDay(utcMs: number): string {
  const date = new Date(utcMs);
  return `${two(date.getHours())}:${two(date.getMinutes())}:${two(date.getSeconds())}`;
}

/** `2026-09-21 14:13:20`. Not by a locale: Node of Debian 12 has none with this form. */
export function dateAndTime(utcMs: number): string {
  const date = new Date(utcMs);
  return `${date.getFullYear()}-${two(date.getMonth() + 1)}-${two(date.getDate())} ${timeOfDay(utcMs)}`;
}

export function plural(number: number, one: string, many: string): string {
  return `${number} ${number === 1 ? one : many}`;
}
