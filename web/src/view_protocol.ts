// What server/streaming/web/view_codec.hpp writes, checked.
import { fields, list, number, numberOrNull, oneOf, text, tuple } from './fields';

export interface CameraInfo {
  body: number;
  camera: number;
  width: number;
  height: number;
  rateHz: number;
}

export interface ViewList {
  access: 'granted' | 'proof' | 'denied';
  /** Remedy, where it is not granted. */
  why: string;
  cameras: CameraInfo[];
}

export type OutlineKind = 'used' | 'rejected' | 'expected' | 'candidate';
export const OUTLINE_KINDS: readonly OutlineKind[] = ['used', 'rejected', 'candidate', 'expected'];

export interface Outline {
  kind: OutlineKind;
  /** null: not read. */
  id: number | null;
  /** See view_words. */
  why: string;
  /** 0: not known. */
  margin: number;
  hamming: number;
  sharpness: number;
  fitPx: number | null;
  sigmaPx: number;
  isNew: boolean;
  /** u0 v0 … u3 v3, pixels of the image; (0, 0) is the centre of the first one. */
  px: number[];
}

export interface Exposure {
  mean: number;
  black: number;
  white: number;
  /** Shares of the pixels at the ends of the sensor. */
  dark: number;
  bright: number;
  steepest: number;
  histogram: number[];
}

export interface CameraView {
  body: number;
  camera: number;
  utcMs: number;
  width: number;
  height: number;
  rateHz: number;
  noise: number;
  speedPxS: number | null;
  /** null: the source gives no images. */
  exposure: Exposure | null;
  blur: { tags: number; focusPx: number; motionPx: number; motionDeg: number };
  /** Candidates were looked for. */
  candidates: boolean;
  outlines: Outline[];
}

export interface ViewPicture {
  view: CameraView;
  /** Empty: there are no images. */
  jpeg: Uint8Array<ArrayBuffer>;
}

export function parseViewList(json: string): ViewList {
  const message = fields(JSON.parse(json), 'views');
  return {
    access: oneOf(message.access, ['granted', 'proof', 'denied'] as const, 'views.access'),
    why: text(message.why, 'views.why'),
    cameras: list(message.cameras, 'views.cameras', (item) => {
      const camera = fields(item, 'camera');
      return {
        body: number(camera.body, 'camera.body'),
        camera: number(camera.camera, 'camera.camera'),
        width: number(camera.width, 'camera.width'),
        height: number(camera.height, 'camera.height'),
        rateHz: number(camera.rate_hz, 'camera.rate_hz'),
      };
    }),
  };
}

function parseOutline(value: unknown): Outline | null {
  const outline = fields(value, 'outline');
  const px = tuple<number[]>(outline.px, 8);
  if (!px) return null;
  return {
    kind: oneOf(outline.kind, OUTLINE_KINDS, 'outline.kind'),
    id: numberOrNull(outline.id),
    why: text(outline.why, 'outline.why'),
    margin: number(outline.margin, 'outline.margin'),
    hamming: number(outline.hamming, 'outline.hamming'),
    sharpness: numberOrNull(outline.sharpness) ?? 0,
    fitPx: numberOrNull(outline.fit_px),
    sigmaPx: numberOrNull(outline.sigma_px) ?? 0,
    isNew: outline.new === true,
    px,
  };
}

function parseExposure(value: unknown): Exposure | null {
  if (value === null) return null;
  const exposure = fields(value, 'exposure');
  return {
    mean: number(exposure.mean, 'exposure.mean'),
    black: number(exposure.black, 'exposure.black'),
    white: number(exposure.white, 'exposure.white'),
    dark: number(exposure.dark, 'exposure.dark'),
    bright: number(exposure.bright, 'exposure.bright'),
    steepest: number(exposure.steepest, 'exposure.steepest'),
    histogram: list(exposure.histogram, 'exposure.histogram', (item) => number(item, 'exposure.histogram')),
  };
}

function parseHeader(json: string): CameraView {
  const view = fields(JSON.parse(json), 'view');
  const blur = fields(view.blur, 'view.blur');
  return {
    body: number(view.body, 'view.body'),
    camera: number(view.camera, 'view.camera'),
    utcMs: number(view.utc_ms, 'view.utc_ms'),
    width: number(view.width, 'view.width'),
    height: number(view.height, 'view.height'),
    rateHz: number(view.rate_hz, 'view.rate_hz'),
    noise: number(view.noise, 'view.noise'),
    speedPxS: numberOrNull(view.speed_px_s),
    exposure: parseExposure(view.exposure),
    blur: {
      tags: number(blur.tags, 'blur.tags'),
      focusPx: number(blur.focus_px, 'blur.focus_px'),
      motionPx: number(blur.motion_px, 'blur.motion_px'),
      motionDeg: number(blur.motion_deg, 'blur.motion_deg'),
    },
    candidates: view.candidates === true,
    outlines: list(view.outlines, 'view.outlines', parseOutline).filter((one): one is Outline => one !== null),
  };
}

/** A message of the views' socket. Throws when it is none. */
export function parsePicture(message: ArrayBuffer): ViewPicture {
  if (message.byteLength < 4) throw new Error('a picture of less than four bytes');
  const length = new DataView(message).getUint32(0, true);
  if (length > message.byteLength - 4) throw new Error('a picture whose header does not end');
  const view = parseHeader(new TextDecoder().decode(new Uint8Array(message, 4, length)));
  return { view, jpeg: new Uint8Array(message, 4 + length) };
}

export interface PictureRequest {
  body: number;
  camera: number;
  width: number;
  perSecond: number;
  candidates: boolean;
}

/** As the server reads it. */
export function requestText(requests: PictureRequest[]): string {
  return requests.map((w) => `${w.body}/${w.camera}/${w.width}/${w.perSecond}/${w.candidates ? 1 : 0}`).join(' ');
}
