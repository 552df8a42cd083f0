import { describe, expect, it } from 'vitest';
import { bySeverity, since } from '../src/events_panel';
import type { ServerEvent, Severity } from '../src/protocol';

const event = (n: number, severity: Severity): ServerEvent => ({
  n, utcMs: 0, severity, subject: 'drone', kind: 'lost', text: '', remedy: '', over: false,
});

describe('bySeverity', () => {
  it('puts the worst first, of equal ones the newest, and leaves mere notes out', () => {
    const order = bySeverity([event(1, 'info'), event(2, 'error'), event(3, 'warning'), event(4, 'error')]);
    expect(order.map((one) => one.n)).toEqual([4, 2, 3]);
  });
});

describe('since', () => {
  const begun = new Date(2026, 10, 23, 14, 3, 5).getTime();

  it('is a time today', () => {
    expect(since(begun, begun + 1000)).toBe('since 14:03:05');
  });

  it('has the date of another day', () => {
    expect(since(begun, begun + 86_400_000)).toBe('since 2026-11-23 14:03:05');
  });
});
