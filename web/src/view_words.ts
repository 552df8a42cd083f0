// Texts about a picture and its outlines.
import { fixed } from './format';
import type { CameraView, Outline, OutlineKind } from './view_protocol';

export const KIND_WORD: Record<OutlineKind, string> = {
  used: 'Used',
  rejected: 'Not used',
  candidate: 'Not a tag',
  expected: 'Expected',
};

const WHY_REJECTED: Record<string, string> = {
  ignored: 'its id is listed in tags.ignore',
  corrected_bits: 'more of its bits had to be corrected than tags.max_hamming allows',
  low_margin: 'its contrast is below detector.min_decision_margin',
  id_twice: 'its id is in this picture more than once',
  outside_lens: 'its corners lie outside of the lens model, or it is seen from behind',
  quarantined: 'it is quarantined: it contradicted its neighbours, or by an operator',
  gate: 'its corners are too far from where the estimate has them: moved, the wrong size, or a poor lens',
  wrong_size: 'its corners do not fit, and its print is not of the configured size (tags.sizes_m)',
  moved: 'it contradicted the others repeatedly: it was moved, or its id is there twice',
  restless: 'it contradicted the others several times recently: it moves, or its id is there twice',
  pending: 'its orientation is ambiguous: look at it from aside or from nearer',
  no_place: 'the body has no pose yet',
  late: 'pictures of this camera come too late to be used',
};

const WHY_CANDIDATE: Record<string, string> = {
  unsearched: 'a good tag; the whole picture is searched now and then only, and this place was not',
  low_margin: 'read, but its contrast is below detector.min_decision_margin',
  too_small: 'a dark square with too few pixels to read its bits: come nearer, or print it larger',
  faint: 'a dark square with hardly any contrast: more light, or another print',
  unread: 'a dark square whose bits are no tag of this family',
};

const nameOf = (outline: Outline): string => (outline.id === null ? 'A square' : `Tag ${outline.id}`);

/** Mean of the sides. */
export function sidePx(outline: Outline): number {
  const at = (i: number): [number, number] => [outline.px[(2 * i) % 8] ?? 0, outline.px[(2 * i + 1) % 8] ?? 0];
  let sum = 0;
  for (let i = 0; i < 4; ++i) {
    const [u, v] = at(i);
    const [u1, v1] = at(i + 1);
    sum += Math.hypot(u1 - u, v1 - v);
  }
  return sum / 4;
}

function measured(outline: Outline): string {
  const parts = [`${fixed(sidePx(outline), 0)} px wide`];
  if (outline.margin > 0) parts.push(`margin ${fixed(outline.margin, 0)}`);
  if (outline.hamming > 0) parts.push(`${outline.hamming} corrected ${outline.hamming === 1 ? 'bit' : 'bits'}`);
  if (outline.sharpness > 0) parts.push(`sharpness ${fixed(outline.sharpness, 2)}`);
  if (outline.fitPx !== null) parts.push(`${fixed(outline.fitPx, 2)} px from the estimate`);
  return parts.join(', ');
}

/** One or two sentences about the selected outline. */
export function outlineWords(outline: Outline): string {
  const name = nameOf(outline);
  switch (outline.kind) {
    case 'used':
      return `${name} is used${outline.isNew ? ', from this picture on' : ''}: ${measured(outline)}.`;
    case 'rejected':
      return `${name} is not used: ${WHY_REJECTED[outline.why] ?? outline.why}. ${measured(outline)}.`;
    case 'candidate':
      return `${name} was not found: ${WHY_CANDIDATE[outline.why] ?? outline.why}. ${measured(outline)}.`;
    case 'expected':
      return `${name} was expected here, within ${fixed(outline.sigmaPx, 1)} px (1σ).`;
  }
}

export type Tone = 'good' | 'warn' | 'bad' | 'none';
export interface Verdict {
  tone: Tone;
  text: string;
}

const SHARP_PX = 2; // a step between two pixels is this wide
const SMEARED_PX = 3;
const UNFOCUSED_PX = 4;
const ALLOWED_PX = 1.5;
const SOFT = 0.3;
const SMALL_PX = 20;
const NOISY = 8;

export function exposureVerdict(view: CameraView): Verdict {
  const e = view.exposure;
  if (!e) return { tone: 'none', text: 'This source gives corners, no pictures' };
  if (e.white < 12) return { tone: 'bad', text: 'Black: is the lens covered, or the exposure far too short?' };
  if (e.black > 243) return { tone: 'bad', text: 'White: expose much shorter' };
  if (e.white - e.black < 25) return { tone: 'bad', text: 'Hardly any contrast: fog, a dirty lens, or a wall very near?' };
  if (e.bright > 0.08) return { tone: 'warn', text: `${fixed(100 * e.bright, 0)} % is overexposed: expose shorter` };
  if (e.white < 90) return { tone: 'warn', text: 'Too dark: expose longer, or add light' };
  if (view.noise > NOISY) return { tone: 'warn', text: `Noisy (${fixed(view.noise, 0)} grays): add light and lower the gain` };
  return { tone: 'good', text: 'Exposure is fine' };
}

export function sharpnessVerdict(view: CameraView): Verdict {
  const { tags, focusPx, motionPx } = view.blur;
  if (tags > 0 && motionPx > SMEARED_PX) {
    const speed = view.speedPxS ?? 0;
    const advice = speed > 100 ? `: at this speed, expose shorter than ${fixed((1000 * ALLOWED_PX) / speed, 1)} ms` : ': shorten the exposure';
    return { tone: 'warn', text: `Blurred by motion over ${fixed(motionPx, 0)} px${advice}` };
  }
  if (tags > 0 && focusPx > UNFOCUSED_PX) return { tone: 'warn', text: `Out of focus: edges are ${fixed(focusPx, 1)} px wide` };
  if (tags > 0) return { tone: 'good', text: `Sharp: edges are ${fixed(Math.max(SHARP_PX, focusPx), 1)} px wide` };
  if (!view.exposure) return { tone: 'none', text: '' };
  if (view.exposure.steepest > 0 && view.exposure.steepest < SOFT) {
    return { tone: 'warn', text: 'No edge is sharp: out of focus, or moving? (no tag to measure it by)' };
  }
  return { tone: 'none', text: 'No tag to measure sharpness by' };
}

export function sizeVerdict(view: CameraView): Verdict {
  const sides = view.outlines.filter((o) => o.kind === 'used' || o.kind === 'rejected').map(sidePx);
  if (sides.length === 0) return { tone: 'none', text: 'No tag is seen' };
  const least = Math.min(...sides);
  const most = Math.max(...sides);
  const words = sides.length === 1 ? `1 tag, ${fixed(most, 0)} px wide` : `${sides.length} tags, ${fixed(least, 0)} to ${fixed(most, 0)} px wide`;
  return most < SMALL_PX ? { tone: 'warn', text: `${words}: small, come nearer or print larger ones` } : { tone: 'good', text: words };
}

/** @param configuredHz the configured rate */
export function rateVerdict(view: CameraView, configuredHz: number): Verdict {
  if (view.rateHz === 0) return { tone: 'none', text: '' };
  const slow = configuredHz > 0 && view.rateHz < 0.8 * configuredHz;
  return { tone: slow ? 'warn' : 'good', text: `${fixed(view.rateHz, 1)} ${slow ? `of ${fixed(configuredHz, 0)} ` : ''}images/s` };
}

const WORSE: Tone[] = ['bad', 'warn', 'good', 'none'];
/** The one to show where there is room for one only. */
export function worstOf(verdicts: Verdict[]): Verdict {
  const sorted = [...verdicts].sort((a, b) => WORSE.indexOf(a.tone) - WORSE.indexOf(b.tone));
  return sorted[0] ?? { tone: 'none', text: '' };
}
