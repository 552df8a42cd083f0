import { describe, expect, it } from 'vitest';
import { outlineAt } from '../src/view_canvas';
import { parsePicture, parseViewList, requestText, type CameraView, type Outline } from '../src/view_protocol';
import { exposureVerdict, outlineWords, rateVerdict, sharpnessVerdict, sidePx, sizeVerdict, worstOf } from '../src/view_words';

const square = (kind: Outline['kind'], id: number | null, at: number, side: number, why = 'used'): Outline => ({
  kind, id, why, margin: 62.4, hamming: 0, sharpness: 0.81, fitPx: null, sigmaPx: 2, isNew: false,
  px: [at, at + side, at + side, at + side, at + side, at, at, at],
});
const VIEW: CameraView = {
  body: 1, camera: 0, utcMs: 0, width: 752, height: 480, rateHz: 20, noise: 2, speedPxS: 500,
  exposure: { mean: 110, black: 12, white: 220, dark: 0, bright: 0, steepest: 0.7, histogram: [1, 2, 3] },
  blur: { tags: 2, focusPx: 2.2, motionPx: 0.4, motionDeg: 0 }, candidates: false, outlines: [],
};
const message = (header: unknown, jpeg: number[] = []): ArrayBuffer => {
  const text = new TextEncoder().encode(JSON.stringify(header));
  const bytes = new Uint8Array(4 + text.length + jpeg.length);
  new DataView(bytes.buffer).setUint32(0, text.length, true);
  bytes.set(text, 4);
  bytes.set(jpeg, 4 + text.length);
  return bytes.buffer;
};
const HEADER = {
  body: 1, camera: 0, utc_ms: 12, width: 752, height: 480, shown: [320, 204], rate_hz: 20, noise: 2, speed_px_s: null,
  exposure: null, blur: { tags: 0, focus_px: 0, motion_px: 0, motion_deg: 0 }, candidates: true,
  outlines: [{ kind: 'candidate', id: null, why: 'faint', margin: 0, hamming: 0, px: [0, 1, 2, 3, 4, 5, 6, 7] }],
};

describe('parsePicture', () => {
  it('takes header and picture apart', () => {
    const { view, jpeg } = parsePicture(message(HEADER, [255, 216]));
    expect(view.outlines).toHaveLength(1);
    expect(view.outlines[0]?.id).toBeNull();
    expect(view.speedPxS).toBeNull();
    expect([...jpeg]).toEqual([255, 216]);
  });

  it('takes nothing that ends too early', () => {
    const whole = message(HEADER);
    for (let size = 0; size < whole.byteLength; ++size) expect(() => parsePicture(whole.slice(0, size))).toThrow();
  });

  it('leaves an outline out that has half a corner', () => {
    const bad = { ...HEADER, outlines: [{ ...HEADER.outlines[0], px: [0, 1, 2, 3, 4, 5, 6, null] }] };
    expect(parsePicture(message(bad)).view.outlines).toEqual([]);
  });
});

describe('parseViewList', () => {
  it('reads who may look at what', () => {
    const list = parseViewList('{"access":"proof","why":"w","cameras":[{"body":1,"camera":0,"width":8,"height":6,"rate_hz":20}]}');
    expect(list).toEqual({ access: 'proof', why: 'w', cameras: [{ body: 1, camera: 0, width: 8, height: 6, rateHz: 20 }] });
    expect(() => parseViewList('{"access":"maybe","why":"","cameras":[]}')).toThrow();
  });
});

describe('requestText', () => {
  it('is what the server reads', () => {
    const request = { body: 1, camera: 0, width: 640, perSecond: 10, candidates: true };
    expect(requestText([request, { ...request, body: 2, width: 320, perSecond: 2, candidates: false }])).toBe('1/0/640/10/1 2/0/320/2/0');
    expect(requestText([])).toBe('');
  });
});

describe('outlineAt', () => {
  const view = { ...VIEW, outlines: [square('expected', 7, 8, 30), square('used', 7, 10, 30), square('candidate', null, 20, 5, 'unread')] };
  const all = new Set(['used', 'expected', 'candidate'] as const);

  it('finds the smallest, and what was found before what was expected', () => {
    expect(outlineAt(view, 22, 22, all)?.kind).toBe('candidate');
    expect(outlineAt(view, 12, 12, all)?.kind).toBe('used');
    expect(outlineAt(view, 8.5, 8.5, all)?.kind).toBe('expected');
    expect(outlineAt(view, 200, 22, all)).toBeNull();
  });

  it('passes over what is switched off', () => {
    expect(outlineAt(view, 12, 12, new Set(['expected'] as const))?.kind).toBe('expected');
  });
});

describe('outlineWords', () => {
  it('says what a tag is and why', () => {
    expect(sidePx(square('used', 7, 10, 30))).toBe(30);
    expect(outlineWords(square('used', 7, 10, 30))).toBe('Tag 7 is used: 30 px wide, margin 62, sharpness 0.81.');
    expect(outlineWords(square('rejected', 3, 10, 30, 'ignored'))).toMatch(/^Tag 3 is not used: its id is listed in tags\.ignore\. /);
    expect(outlineWords(square('candidate', null, 10, 30, 'unread'))).toMatch(/^A square was not found: .*no tag of this family\. /);
    expect(outlineWords(square('expected', 4, 10, 30))).toBe('Tag 4 was expected here, within 2.0 px (1σ).');
  });

  it('knows every reason of the server', () => {
    const reasons = ['ignored', 'corrected_bits', 'low_margin', 'id_twice', 'outside_lens', 'quarantined', 'gate', 'wrong_size', 'moved', 'restless', 'pending', 'no_place', 'late'];
    for (const why of reasons) expect(outlineWords(square('rejected', 1, 0, 9, why))).not.toContain(`: ${why}.`);
    for (const why of ['unsearched', 'low_margin', 'too_small', 'faint', 'unread']) {
      expect(outlineWords(square('candidate', 1, 0, 9, why))).not.toContain(`: ${why}.`);
    }
  });
});

describe('verdicts', () => {
  const exposed = (change: Partial<NonNullable<CameraView['exposure']>>): CameraView => ({ ...VIEW, exposure: { ...VIEW.exposure!, ...change } });
  const blurred = (change: Partial<CameraView['blur']>): CameraView => ({ ...VIEW, blur: { ...VIEW.blur, ...change } });

  it('of the exposure say what to do', () => {
    expect(exposureVerdict(VIEW)).toEqual({ tone: 'good', text: 'Exposure is fine' });
    expect(exposureVerdict(exposed({ white: 5, black: 0 })).text).toMatch(/^Black/);
    expect(exposureVerdict(exposed({ white: 70 })).text).toMatch(/^Too dark: expose longer/);
    expect(exposureVerdict(exposed({ bright: 0.3 })).text).toMatch(/^30 % is overexposed.*shorter/);
    expect(exposureVerdict(exposed({ white: 130, black: 120 })).text).toMatch(/contrast/);
    expect(exposureVerdict({ ...VIEW, noise: 14 }).text).toMatch(/^Noisy \(14/);
  });

  it('of the sharpness tell motion and focus apart', () => {
    expect(sharpnessVerdict(VIEW).tone).toBe('good');
    expect(sharpnessVerdict(blurred({ motionPx: 6 })).text).toBe('Blurred by motion over 6 px: at this speed, expose shorter than 3.0 ms');
    expect(sharpnessVerdict({ ...blurred({ motionPx: 6 }), speedPxS: null }).text).toMatch(/: shorten the exposure$/);
    expect(sharpnessVerdict(blurred({ focusPx: 6.2 })).text).toBe('Out of focus: edges are 6.2 px wide');
    expect(sharpnessVerdict({ ...exposed({ steepest: 0.1 }), blur: { ...VIEW.blur, tags: 0 } }).tone).toBe('warn');
  });

  it('of tags and rate', () => {
    expect(sizeVerdict({ ...VIEW, outlines: [square('used', 1, 0, 12)] }).tone).toBe('warn');
    expect(sizeVerdict({ ...VIEW, outlines: [square('used', 1, 0, 12), square('rejected', 2, 0, 60, 'gate')] }).text).toBe('2 tags, 12 to 60 px wide');
    expect(rateVerdict(VIEW, 20)).toEqual({ tone: 'good', text: '20.0 images/s' });
    expect(rateVerdict({ ...VIEW, rateHz: 14 }, 20)).toEqual({ tone: 'warn', text: '14.0 of 20 images/s' });
  });

  it('show the worst where there is room for one', () => {
    expect(worstOf([{ tone: 'good', text: 'a' }, { tone: 'bad', text: 'b' }, { tone: 'none', text: '' }]).text).toBe('b');
  });
});
