// State of the server in set-up (GET /api/v1/setup), checked.
import { fields, list, number, numberOrNull, oneOf, text, tuple, type Fields } from '../fields';

export const STEPS = [
  'camera', 'picture', 'sheet', 'lens', 'imu', 'rest', 'mount', 'wave', 'finish',
] as const;
export type StepName = (typeof STEPS)[number];

export interface CameraFound {
  open: string;
  name: string;
  /** Why it cannot be opened now; empty: nothing is known against it. */
  problem: string;
}

export interface TagOutline {
  id: number;
  margin: number;
  /** Four, pixels of the image. */
  corners: [number, number][];
}

export interface Picture {
  width: number;
  height: number;
  rateHz: number;
  histogram: number[];
  brightShare: number;
  darkShare: number;
  /** null: no tag to measure it by. */
  focusPx: number | null;
  motionPx: number | null;
  verdict: string;
  good: boolean;
  outlines: TagOutline[];
}

export interface Lens {
  columns: number;
  rows: number;
  /** Row by row from the top; two or more: covered. */
  points: number[];
  covered: number;
  views: number;
  tilted: number;
  hint: string;
  enough: boolean;
}

export interface Imu {
  used: boolean;
  simulated: boolean;
  rateHz: number;
  types: string[];
  parts: string[];
}

export interface Wave {
  /** How much of what is needed: about x forward, y left, z up. */
  turned: [number, number, number];
  shaken: number;
  seen: number;
  hint: string;
}

/** Result of a step. */
export interface StepVerdict {
  good: boolean;
  /** It may not be used. */
  refused: boolean;
  summary: string;
  advice: string[];
}

export interface SetupState {
  step: StepName;
  /** Skipped: passed without a result of its own. */
  steps: { name: StepName; leftOut: boolean; skipped: boolean }[];
  file: string;
  /** The file is there already. */
  exists: boolean;
  /** Why `next` would be refused; empty: it would not. */
  missing: string;
  error: string;
  solving: boolean;
  cameras: CameraFound[];
  camera: { open: string; exposureMs: number | null } | null;
  picture: Picture | null;
  sheet: { family: string; sizeMm: number; families: string[] };
  lens: Lens | null;
  imu: Imu | null;
  rest: { share: number; hint: string } | null;
  wave: Wave | null;
  verdict: StepVerdict | null;
  written: boolean;
  configuration: string;
}

const isSet = (value: unknown): boolean => value !== null && value !== undefined;

/** Parts that do not exist before their step. */
function part<T>(value: unknown, what: string, read: (from: Fields) => T): T | null {
  return isSet(value) ? read(fields(value, what)) : null;
}

const texts = (value: unknown, what: string): string[] =>
  list(value, what, (item) => text(item, what));

function parseOutline(value: unknown): TagOutline {
  const outline = fields(value, 'outline');
  const corners = list(outline.corners, 'outline.corners', (corner) => {
    const found = tuple<[number, number]>(corner, 2);
    if (!found) throw new Error('outline.corners: expected two numbers');
    return found;
  });
  if (corners.length !== 4) throw new Error('outline.corners: expected four');
  return {
    id: number(outline.id, 'outline.id'),
    margin: number(outline.margin, 'outline.margin'),
    corners,
  };
}

function size(value: unknown, what: string): number {
  const pixels = number(value, what);
  if (pixels < 1 || pixels > 65536) throw new Error(`${what}: ${pixels} is no size of an image`);
  return pixels;
}

function parsePicture(picture: Fields): Picture {
  return {
    width: size(picture.width, 'picture.width'),
    height: size(picture.height, 'picture.height'),
    rateHz: number(picture.rate_hz, 'picture.rate_hz'),
    histogram: list(picture.histogram, 'picture.histogram', (n) => number(n, 'histogram')),
    brightShare: number(picture.bright_share, 'picture.bright_share'),
    darkShare: number(picture.dark_share, 'picture.dark_share'),
    focusPx: numberOrNull(picture.focus_px),
    motionPx: numberOrNull(picture.motion_px),
    verdict: text(picture.verdict, 'picture.verdict'),
    good: picture.good === true,
    outlines: list(picture.outlines, 'picture.outlines', parseOutline),
  };
}

function parseLens(lens: Fields): Lens {
  const read: Lens = {
    columns: number(lens.columns, 'lens.columns'),
    rows: number(lens.rows, 'lens.rows'),
    points: list(lens.points, 'lens.points', (n) => number(n, 'lens.points')),
    covered: number(lens.covered, 'lens.covered'),
    views: number(lens.views, 'lens.views'),
    tilted: number(lens.tilted, 'lens.tilted'),
    hint: text(lens.hint, 'lens.hint'),
    enough: lens.enough === true,
  };
  if (read.points.length !== read.columns * read.rows)
    throw new Error(`lens.points: ${read.points.length} for ${read.columns} × ${read.rows}`);
  return read;
}

function parseWave(wave: Fields): Wave {
  const turned = tuple<[number, number, number]>(wave.turned, 3);
  if (!turned) throw new Error('wave.turned: expected three numbers');
  return {
    turned,
    shaken: number(wave.shaken, 'wave.shaken'),
    seen: number(wave.seen, 'wave.seen'),
    hint: text(wave.hint, 'wave.hint'),
  };
}

function parseVerdict(verdict: Fields): StepVerdict {
  return {
    good: verdict.good === true,
    refused: verdict.refused === true,
    summary: text(verdict.summary, 'verdict.summary'),
    advice: texts(verdict.advice, 'verdict.advice'),
  };
}

function parseImu(imu: Fields): Imu {
  return {
    used: imu.used === true,
    simulated: imu.simulated === true,
    rateHz: number(imu.rate_hz, 'imu.rate_hz'),
    types: texts(imu.types, 'imu.types'),
    parts: texts(imu.parts, 'imu.parts'),
  };
}

function parseCamera(value: unknown): CameraFound {
  const camera = fields(value, 'camera');
  return {
    open: text(camera.open, 'camera.open'),
    name: text(camera.name, 'camera.name'),
    problem: text(camera.problem, 'camera.problem'),
  };
}

/** Throws a message when the state is malformed. */
export function parseSetup(json: string): SetupState {
  const state = fields(JSON.parse(json), 'setup');
  const step = oneOf(state.step, STEPS, 'step');
  const sheet = fields(state.sheet, 'sheet');
  return {
    step,
    steps: list(state.steps, 'steps', (item) => {
      const one = fields(item, 'steps');
      const name = oneOf(one.name, STEPS, 'steps.name');
      return { name, leftOut: one.left_out === true, skipped: one.skipped === true };
    }),
    file: text(state.file, 'file'),
    exists: state.exists === true,
    missing: text(state.missing, 'missing'),
    error: text(state.error, 'error'),
    solving: state.solving === true,
    cameras: list(state.cameras, 'cameras', parseCamera),
    camera: part(state.camera, 'camera', (camera) => ({
      open: text(camera.open, 'camera.open'),
      exposureMs: numberOrNull(camera.exposure_ms),
    })),
    picture: part(state.picture, 'picture', parsePicture),
    sheet: {
      family: text(sheet.family, 'sheet.family'),
      sizeMm: number(sheet.size_mm, 'sheet.size_mm'),
      families: texts(sheet.families, 'sheet.families'),
    },
    lens: part(state.lens, 'lens', parseLens),
    imu: part(state.imu, 'imu', parseImu),
    rest: part(state.rest, 'rest', (rest) => ({
      share: number(rest.share, 'rest.share'),
      hint: text(rest.hint, 'rest.hint'),
    })),
    wave: part(state.wave, 'wave', parseWave),
    verdict: part(state.verdict, 'verdict', parseVerdict),
    written: state.written === true,
    configuration: isSet(state.configuration) ? text(state.configuration, 'configuration') : '',
  };
}
