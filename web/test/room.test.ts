import { describe, expect, it } from 'vitest';
import { framesPerSecond, summaryOf } from '../src/clients_panel';
import { liveUrl, retryDelay } from '../src/connection';
import { ellipsoid } from '../src/covariance';
import { mapLine } from '../src/map_line';
import { extentOf } from '../src/room_view';

describe('ellipsoid', () => {
  it('has the square roots of a diagonal covariance as half axes', () => {
    expect(ellipsoid([4, 0, 0, 9, 0, 16]).radii).toEqual([2, 3, 4]);
  });

  it('rebuilds a full covariance from its axes', () => {
    const cov = [5, 1, -2, 4, 0.5, 3] as const;
    const { radii, axes } = ellipsoid([...cov]);
    const rebuilt = (i: number, j: number) =>
      radii.reduce((sum, radius, k) => sum + radius * radius * axes[3 * i + k]! * axes[3 * j + k]!, 0);
    const upper = [rebuilt(0, 0), rebuilt(0, 1), rebuilt(0, 2), rebuilt(1, 1), rebuilt(1, 2), rebuilt(2, 2)];
    upper.forEach((value, i) => expect(value).toBeCloseTo(cov[i]!, 9));
  });

  it('is flat, not NaN, when a variance is slightly negative', () => {
    expect(ellipsoid([1e-6, 0, 0, -1e-18, 0, 1e-6]).radii[1]).toBe(0);
  });
});

describe('extentOf', () => {
  it('is in whole metres around everything and the origin', () => {
    expect(extentOf([[1.2, 2, 0.5], [4.7, 3.1, 2.5]])).toEqual({ x0: 0, x1: 5, y0: 0, y1: 4, top: 2.5 });
  });
  it('is a small room while nothing is known', () => expect(extentOf([]).x1).toBeGreaterThan(0));
});

describe('connection', () => {
  it('waits longer after every failure, up to a limit', () => {
    expect([1, 2, 3, 4, 9].map(retryDelay)).toEqual([500, 1000, 2000, 4000, 5000]);
  });
  it('finds the socket beside the page, also below a path and with TLS', () => {
    expect(liveUrl('http://hall:8080/')).toBe('ws://hall:8080/api/v1/live');
    expect(liveUrl('https://lab.example/mocap/')).toBe('wss://lab.example/mocap/api/v1/live');
  });
});

describe('summaries', () => {
  const client = { protocol: 'vrpn', peer: '', detail: '', sent: 1, dropped: 0, connectedS: 1, clock: null };
  it('counts clients per protocol and their drops', () => {
    expect(summaryOf([client, { ...client, protocol: 'web' }, client])).toBe('vrpn 2 · web 1 · nothing dropped');
    expect(summaryOf([{ ...client, dropped: 214 }])).toBe('vrpn 1 · 214 frames dropped');
    expect(summaryOf([])).toBe('');
  });
  it('takes the rate of frames by the server\'s clock', () => {
    expect(framesPerSecond(undefined, client)).toBeNull();
    expect(framesPerSecond(client, { ...client, sent: 201, connectedS: 3 })).toBe(100);
    expect(framesPerSecond(client, { ...client, sent: 0, connectedS: 2 })).toBeNull();
    expect(framesPerSecond(client, client)).toBeNull();
  });
  it('says that a map was never stored', () => {
    expect(mapLine({ type: 'map', version: 0, family: 'tag36h11', referenceTag: null, tags: [] }, 'mapping')).toBe(
      'Not stored · 0 tags · tag36h11 · mapping',
    );
  });
});
