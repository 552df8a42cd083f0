import { describe, expect, it } from 'vitest';
import { picked, placesFor, seenFrom, turnTowards, UNCHANGED, usableTags, type Origin } from '../src/origin';
import type { MapTag, Vector3 } from '../src/protocol';

const tag = (id: number, p: Vector3, state: MapTag['state'] = 'calibrated'): MapTag => ({
  id, edgeM: 0.2, state, component: 0, sightings: 40, lastSeenUtcMs: 1000, p, q: [1, 0, 0, 0], sigmaMm: 2, cov: null,
});

const close = (a: readonly number[], b: readonly number[]): void => {
  expect(a.length).toBe(b.length);
  a.forEach((value, i) => expect(value).toBeCloseTo(b[i] ?? NaN, 9));
};

describe('the origin', () => {
  it('is where it is until it is chosen', () => {
    close(seenFrom(UNCHANGED, [1, 2, 3]), [1, 2, 3]);
  });

  it('is at zero, and what lies on its x axis has no y', () => {
    const origin: Origin = { x: 2, y: -1, z: 0.5, turn: 30 };
    close(seenFrom(origin, [2, -1, 0.5]), [0, 0, 0]);
    const a = (30 * Math.PI) / 180;
    close(seenFrom(origin, [2 + 3 * Math.cos(a), -1 + 3 * Math.sin(a), 1]), [3, 0, 0.5]);
  });

  it('is picked by three tags: place, x axis, height', () => {
    let origin = picked(UNCHANGED, 'origin', tag(1, [1, 1, 0.3]));
    origin = picked(origin, 'heading', tag(2, [1, 5, 2]));
    origin = picked(origin, 'floor', tag(3, [9, 9, 0.1]));
    expect(origin).toEqual({ x: 1, y: 1, z: 0.1, turn: 90 });
    close(seenFrom(origin, [1, 5, 2]), [4, 0, 1.9]);
    // The tag of the origin itself has no direction.
    expect(picked(origin, 'heading', tag(1, [1, 1, 0.3])).turn).toBe(90);
    expect(turnTowards(origin, [1, 1])).toBeNull();
  });

  it('is told by where tags stand in it, as many as are needed', () => {
    const tags = [tag(1, [0, 0, 0]), tag(2, [4, 0, 0]), tag(3, [0, 3, 1]), tag(4, [9, 9, 9], 'quarantined')];
    const places = placesFor({ x: 4, y: 0, z: 0, turn: 180 }, tags);
    expect(places.map((place) => place.tag).sort()).toEqual([1, 2, 3]);
    close(places.find((place) => place.tag === 3)?.p ?? [], [4, -3, 1]);
    expect(usableTags(tags).length).toBe(3);
    expect(() => placesFor(UNCHANGED, tags.slice(1))).toThrow('2 of the 3 tags');
    const many = Array.from({ length: 40 }, (_, i) => tag(i, [i, i % 2, 0]));
    expect(placesFor(UNCHANGED, many).length).toBe(12);
  });
});
