// Readers of untrusted values: everything is checked, and faults are named.

export type Fields = Record<string, unknown>;

export function fields(value: unknown, what: string): Fields {
  if (typeof value !== 'object' || value === null || Array.isArray(value)) throw new Error(`${what}: expected an object`);
  return value as Fields;
}

export function list<T>(value: unknown, what: string, one: (item: unknown) => T): T[] {
  if (!Array.isArray(value)) throw new Error(`${what}: expected a list`);
  return value.map(one);
}

export function number(value: unknown, what: string): number {
  if (typeof value !== 'number' || !Number.isFinite(value)) throw new Error(`${what}: expected a number`);
  return value;
}

export function numberOrNull(value: unknown): number | null {
  return typeof value === 'number' && Number.isFinite(value) ? value : null;
}

export function text(value: unknown, what: string): string {
  if (typeof value !== 'string') throw new Error(`${what}: expected a text`);
  return value;
}

export function oneOf<T extends string>(value: unknown, known: readonly T[], what: string): T {
  const found = known.find((name) => name === value);
  if (found === undefined) throw new Error(`${what}: ${String(value)} is none of ${known.join(', ')}`);
  return found;
}

/** A tuple of finite numbers; anything else is null: half a position is none. */
export function tuple<T extends number[]>(value: unknown, length: number): T | null {
  if (!Array.isArray(value) || value.length !== length) return null;
  return value.every((item) => typeof item === 'number' && Number.isFinite(item)) ? (value as T) : null;
}
