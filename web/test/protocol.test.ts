import { describe, expect, it } from 'vitest';
import { parseMessage } from '../src/protocol';

const body = {
  id: 1, state: 'tracking', valid: true, p: [1, 2, 3], q: [1, 0, 0, 0], v: [0, 0, 0], speed: 0.5, turn_rate_deg_s: 1,
  sigma_mm: 2.5, sigma_deg: 0.1, cov: [1, 0, 0, 1, 0, 1], age_ms: 20, latency_ms: 8, tags: 3, image_rate_hz: 20,
  reprojection_px: 0.3, images_dropped: 0,
};
const frame = { type: 'frame', number: 7, utc_ms: 1700000000000, rate_hz: 100, map_version: 1, bodies: [body] };
const parseFrame = (change: object) => {
  const message = parseMessage(JSON.stringify({ ...frame, bodies: [{ ...body, ...change }] }));
  if (message?.type !== 'frame') throw new Error('no frame');
  return message.bodies[0];
};

describe('parseMessage', () => {
  const event = { n: 3, utc_ms: 5, severity: 'error', subject: 'drone', kind: 'lost', text: 'why', remedy: 'what', over: false };

  it('reads what holds and what happened', () => {
    const message = { type: 'events', standing: [event], events: [event, { ...event, n: 4, over: true }] };
    const read = { n: 3, utcMs: 5, severity: 'error', subject: 'drone', kind: 'lost', text: 'why', remedy: 'what', over: false };
    expect(parseMessage(JSON.stringify(message))).toEqual({
      type: 'events', standing: [read], events: [read, { ...read, n: 4, over: true }],
    });
  });

  it('refuses an event of an unknown severity', () => {
    const message = { type: 'events', standing: [{ ...event, severity: '<b>' }], events: [] };
    expect(() => parseMessage(JSON.stringify(message))).toThrow(/severity/);
  });

  it('reads hello with its bodies', () => {
    const hello = { type: 'hello', server: 'hall', version: '0.1.0', map_mode: 'frozen', page_rate_hz: 20, bodies: [{ id: 4, name: 'cart' }] };
    expect(parseMessage(JSON.stringify(hello))).toEqual({
      type: 'hello', server: 'hall', version: '0.1.0', mapMode: 'frozen', pageRateHz: 20, takesCommands: false, bodies: [{ id: 4, name: 'cart' }],
    });
  });

  it('reads every field of a body', () => {
    expect(parseFrame({})).toEqual({
      id: 1, state: 'tracking', valid: true,
      pose: { p: [1, 2, 3], q: [1, 0, 0, 0], speed: 0.5, sigmaMm: 2.5, sigmaDeg: 0.1, cov: [1, 0, 0, 1, 0, 1], ageMs: 20 },
      latencyMs: 8, tags: 3, imageRateHz: 20, reprojectionPx: 0.3, imagesDropped: 0,
    });
  });

  it('has no pose for a body that was never placed', () => {
    expect(parseFrame({ valid: false, state: 'searching', p: null, q: null })?.pose).toBeNull();
  });

  it('never calls half a position valid', () => {
    const seen = parseFrame({ p: [1, null, 3] });
    expect(seen?.pose).toBeNull();
    expect(seen?.valid).toBe(false);
  });

  it('keeps the last pose of a lost body and its invalidity', () => {
    const seen = parseFrame({ valid: false, state: 'lost' });
    expect(seen?.pose?.p).toEqual([1, 2, 3]);
    expect(seen?.valid).toBe(false);
  });

  it('names a state it does not know', () => {
    expect(() => parseFrame({ state: 'flying' })).toThrow(/flying is none of searching/);
  });

  it('reads the map and leaves out a tag without a place', () => {
    const tag = { id: 5, edge_m: 0.16, state: 'local', component: 0, sightings: 9, p: [0, 0, 1], q: [1, 0, 0, 0], sigma_mm: 2, cov: null };
    const map = { type: 'map', version: 3, parent: 2, hash: '', family: 'tag36h11', reference_tag: null, comment: '', tags: [tag, { ...tag, id: 6, p: null }] };
    const message = parseMessage(JSON.stringify(map));
    expect(message).toMatchObject({ type: 'map', version: 3, referenceTag: null });
    expect(message?.type === 'map' && message.tags.map((entry) => entry.id)).toEqual([5]);
  });

  it('reads clients and log lines', () => {
    const clients = { type: 'clients', clients: [{ protocol: 'vrpn', peer: 'p', detail: 'd', sent: 5, dropped: 1, connected_s: 2, clock_offset_s: -0.5, clock_sigma_s: 0.001 }] };
    expect(parseMessage(JSON.stringify(clients))).toEqual({
      type: 'clients', clients: [{ protocol: 'vrpn', peer: 'p', detail: 'd', sent: 5, dropped: 1, connectedS: 2, clock: { offsetS: -0.5, sigmaS: 0.001 } }],
    });
    const log = { type: 'log', lines: [{ n: 1, utc_ms: 5, level: 'warning', module: 'vrpn', text: 't' }] };
    expect(parseMessage(JSON.stringify(log))).toEqual({
      type: 'log', lines: [{ n: 1, utcMs: 5, level: 'warning', module: 'vrpn', text: 't' }],
    });
  });

  it('takes half a clock for none', () => {
    const client = { protocol: 'vrpn', peer: 'p', detail: 'd', sent: 5, dropped: 1, connected_s: 2, clock_offset_s: 1, clock_sigma_s: null };
    const message = parseMessage(JSON.stringify({ type: 'clients', clients: [client] }));
    expect(message?.type === 'clients' && message.clients[0]?.clock).toBeNull();
  });

  it('passes over messages of a newer server', () => {
    expect(parseMessage('{"type":"weather"}')).toBeNull();
  });

  it.each(['', 'null', '[]', '{"type":"frame"}', '{"type":"clients","clients":{}}', '{"type":"hello","server":5}'])(
    'throws for %s',
    (text) => expect(() => parseMessage(text)).toThrow(),
  );
});
