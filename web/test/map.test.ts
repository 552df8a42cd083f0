import { describe, expect, it } from 'vitest';
import { exaggeration } from '../src/changes_view';
import { eventWords } from '../src/map_commands';
import { diffWords, oddFit, tagCells } from '../src/map_panel';
import { parsePlaces } from '../src/measured_places';
import { controlUrl } from '../src/operator';
import type { MapTag, ServerEvent, TagChange } from '../src/protocol';

const moved = (mm: number): TagChange => ({ id: 1, kind: 'moved', mm, deg: 0, from: [0, 0, 0], to: [mm / 1e3, 0, 0] });
const told = (text: string, remedy = ''): ServerEvent => ({
  n: 1, utcMs: 0, severity: 'info', subject: 'map', kind: 'x', text, remedy, over: false,
});

describe('exaggeration', () => {
  it('makes the longest arrow visible, and is a round number', () => {
    expect(exaggeration([moved(500), moved(2)])).toBe(1);
    expect(exaggeration([moved(60)])).toBe(10);
    expect(exaggeration([moved(5)])).toBe(100);
    expect(exaggeration([moved(0.01)])).toBe(1000);
    expect(exaggeration([])).toBe(1);
  });

  it('is said', () => {
    expect(diffWords({ before: 3, after: 4, changes: [moved(5)] })).toBe(
      'Version 3 → 4: 1 tag differs. Arrows in the room are 100 times as long, at least 10 cm.',
    );
  });
});

describe('tagCells', () => {
  const tag: MapTag = {
    id: 7, edgeM: 0.2, state: 'calibrated', component: 0, sightings: 40, lastSeenUtcMs: 1000, p: [0, 0, 0], q: [1, 0, 0, 0], sigmaMm: 2, cov: null,
  };

  it('tells when it was seen last, by the map or by a body', () => {
    expect(tagCells(tag, null, 61_000)).toEqual(['calibrated', '2.00', '–', '40', '60 s ago']);
    const fit = { id: 7, px: 0.314, sightings: 3, lastSeenUtcMs: 60_000 };
    expect(tagCells(tag, fit, 61_000)).toEqual(['calibrated', '2.00', '0.31', '40', 'now']);
    expect(tagCells({ ...tag, lastSeenUtcMs: null }, null, 61_000)[4]).toBe('–');
    expect(tagCells(tag, null, 864_001_000)[4]).toBe('10 d ago');
  });
});

describe('oddFit', () => {
  it('is thrice the middle one, and never below a pixel', () => {
    expect(oddFit([0.2, null, 0.3, 5])).toBe(1);
    expect(oddFit([2, 1, 3])).toBe(6);
    expect(oddFit([])).toBe(1);
  });
});

describe('parsePlaces', () => {
  it('reads a line for each tag, with blanks or commas', () => {
    expect(parsePlaces('0 0 0 0\n\n 12, 1.5, -2 , 0.25\n7;1;2;3')).toEqual([
      { tag: 0, p: [0, 0, 0] },
      { tag: 12, p: [1.5, -2, 0.25] },
      { tag: 7, p: [1, 2, 3] },
    ]);
  });

  it('names the line that it cannot read', () => {
    for (const line of ['1 2 3', '1 2 3 4 5', 'a 1 2 3', '-1 0 0 0', '1.5 0 0 0', '1 0 0 Infinity'])
      expect(() => parsePlaces(line)).toThrow(line);
    expect(() => parsePlaces('0 0 0 0\n1 1 1 1')).toThrow('Three tags are needed, 2 given');
  });
});

describe('eventWords', () => {
  it('makes a sentence of what the server says of its map', () => {
    expect(eventWords(told('is frozen'))).toBe('The map is frozen.');
    expect(eventWords(told('tag 7 was forgotten'))).toBe('Tag 7 was forgotten.');
    expect(eventWords(told('the map is not stored: disk', 'mend it'))).toBe('The map is not stored: disk. mend it.');
  });
});

describe('controlUrl', () => {
  it('is beside the page, also below the path of a proxy', () => {
    expect(controlUrl('https://hall.example/cap/')).toBe('wss://hall.example/cap/api/v1/control');
  });
});
