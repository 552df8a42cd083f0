import { describe, expect, it } from 'vitest';
import { alarmsOf } from '../src/alarms';
import { since } from '../src/events_panel';
import type { ServerEvent, Severity } from '../src/protocol';

const event = (n: number, severity: Severity, kind = 'lost', subject = 'drone'): ServerEvent => ({
  n, utcMs: 1000 * n, severity, subject, kind, text: '', remedy: '', over: false,
});

const kinds = (events: ServerEvent[]): string[] => alarmsOf(events).map(({ subjects, worst }) => `${subjects.join('+')} ${worst.kind}`);

describe('alarmsOf', () => {
  it('puts the worst first, of equal ones the oldest, and leaves notes out', () => {
    const order = alarmsOf([event(1, 'info'), event(2, 'error'), event(3, 'warning', 'disk'), event(4, 'error', 'x')]);
    expect(order.map((one) => one.worst.n)).toEqual([2, 4, 3]);
  });

  it('makes one of a busy computer, and none of what follows from it', () => {
    const standing = [
      event(1, 'warning', 'overload', 'drone'), event(2, 'warning', 'overload', 'rover'),
      event(3, 'warning', 'map_late', 'map'), event(4, 'warning', 'overload', 'server'),
      event(5, 'error', 'tracking', 'drone'), event(6, 'warning', 'image_rate', 'rover'),
      event(7, 'warning', 'source_late', 'walker'), event(8, 'warning', 'silent_1', 'walker'),
    ];
    expect(kinds(standing)).toEqual(['drone+map+rover+server overload']);
    expect(alarmsOf(standing)[0]?.utcMs).toBe(1000);
    const late = event(9, 'error', 'map_late', 'map');
    expect(alarmsOf([late, event(1, 'warning', 'overload')])[0]?.worst.kind).toBe('overload');
  });

  it('keeps what has another cause', () => {
    const standing = [event(1, 'warning', 'overload', 'drone'), event(2, 'error', 'tracking', 'rover')];
    expect(kinds(standing)).toEqual(['rover tracking', 'drone overload']);
  });

  it('tells the cause of a lost body only', () => {
    const lost = event(9, 'error', 'tracking', 'drone');
    for (const cause of ['camera', 'silent', 'image_dark', 'source_failed', 'source_late'])
      expect(kinds([event(1, 'warning', cause, 'drone'), lost])).toEqual([`drone ${cause}`]);
    expect(kinds([event(1, 'error', 'camera_1', 'drone'), event(2, 'warning', 'silent_1', 'drone'), lost])).toEqual(['drone camera_1']);
    expect(kinds([event(1, 'error', 'imu_readings', 'drone'), lost])).toHaveLength(2);
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
