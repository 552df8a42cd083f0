import { sidePx } from './view_words';
import type { CameraView, Outline, OutlineKind } from './view_protocol';

/** Distinguished by colour and by dashes, for people who do not see colours. */
export const KIND_STYLE: Record<OutlineKind, { colour: string; dash: number[] }> = {
  used: { colour: '#4fd08b', dash: [] },
  rejected: { colour: '#ff7a70', dash: [9, 4] },
  candidate: { colour: '#f0b44c', dash: [2, 4] },
  expected: { colour: '#8cc8ff', dash: [5, 6] },
};
const LABEL_FROM_PX = 26; // of the screen: smaller tags would hide behind their names

export interface Shown {
  view: CameraView;
  /** null: there is no image, or it could not be read. */
  bitmap: ImageBitmap | null;
}

export interface DrawOptions {
  kinds: ReadonlySet<OutlineKind>;
  chosen: Outline | null;
  labels: boolean;
}

/** Pixels of the canvas per pixel of the image. */
export function scaleOf(canvas: HTMLCanvasElement, view: CameraView): number {
  return canvas.width / Math.max(1, view.width);
}

/** Corner `i` on the canvas; the centre of the first pixel is half a pixel from the edge. */
function corner(outline: Outline, i: number, scale: number): [number, number] {
  return [((outline.px[2 * i] ?? 0) + 0.5) * scale, ((outline.px[2 * i + 1] ?? 0) + 0.5) * scale];
}

function trace(context: CanvasRenderingContext2D, outline: Outline, scale: number): void {
  context.beginPath();
  for (let i = 0; i < 4; ++i) context.lineTo(...corner(outline, i, scale));
  context.closePath();
}

export function draw(canvas: HTMLCanvasElement, shown: Shown, options: DrawOptions): void {
  const context = canvas.getContext('2d');
  if (!context) return;
  const { view, bitmap } = shown;
  context.setLineDash([]);
  if (bitmap) context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  if (!bitmap) {
    context.fillStyle = '#182129';
    context.fillRect(0, 0, canvas.width, canvas.height);
  }
  const scale = scaleOf(canvas, view);
  const ratio = canvas.width / Math.max(1, canvas.clientWidth);
  // The most important ones are on top.
  for (const kind of ['expected', 'candidate', 'rejected', 'used'] as const) {
    if (!options.kinds.has(kind)) continue;
    for (const outline of view.outlines) if (outline.kind === kind) drawOutline(context, outline, scale, ratio, options);
  }
}

function drawOutline(context: CanvasRenderingContext2D, outline: Outline, scale: number, ratio: number, options: DrawOptions): void {
  const style = KIND_STYLE[outline.kind];
  const isChosen = outline === options.chosen;
  trace(context, outline, scale);
  context.lineWidth = (isChosen ? 3.5 : 1.75) * ratio;
  context.strokeStyle = style.colour;
  context.setLineDash(style.dash.map((length) => length * ratio));
  context.stroke();
  if (isChosen) {
    context.globalAlpha = 0.22;
    context.fillStyle = style.colour;
    context.fill();
    context.globalAlpha = 1;
  }
  const isLabelled = options.labels && outline.id !== null && outline.kind !== 'expected';
  if (isLabelled && sidePx(outline) * scale > LABEL_FROM_PX * ratio) label(context, outline, scale, ratio, style.colour);
}

/** Its id, in the middle, in place of the bits. */
function label(context: CanvasRenderingContext2D, outline: Outline, scale: number, ratio: number, colour: string): void {
  let [x, y] = [0, 0];
  for (let i = 0; i < 4; ++i) {
    const [u, v] = corner(outline, i, scale);
    x += u / 4;
    y += v / 4;
  }
  context.font = `600 ${13 * ratio}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  const words = String(outline.id);
  const width = context.measureText(words).width + 9 * ratio;
  context.fillStyle = 'rgb(11 15 19 / 0.82)';
  context.fillRect(x - width / 2, y - 9 * ratio, width, 18 * ratio);
  context.fillStyle = colour;
  context.fillText(words, x, y + ratio);
}

const isInside = (outline: Outline, u: number, v: number): boolean => {
  let inside = false;
  for (let i = 0, j = 3; i < 4; j = i++) {
    const [ui = 0, vi = 0] = [outline.px[2 * i], outline.px[2 * i + 1]];
    const [uj = 0, vj = 0] = [outline.px[2 * j], outline.px[2 * j + 1]];
    if (vi > v !== vj > v && u < ((uj - ui) * (v - vi)) / (vj - vi) + ui) inside = !inside;
  }
  return inside;
};

/** What lies under a point of the image: found ones before expected ones, the smallest first. */
export function outlineAt(view: CameraView, u: number, v: number, kinds: ReadonlySet<OutlineKind>): Outline | null {
  const hit = view.outlines.filter((outline) => kinds.has(outline.kind) && isInside(outline, u, v));
  const rank = (outline: Outline): number => (outline.kind === 'expected' ? 1e6 : 0) + sidePx(outline);
  return hit.sort((a, b) => rank(a) - rank(b))[0] ?? null;
}

/** Bars of how many pixels have which gray; the ends of the sensor stand out. */
export function drawHistogram(canvas: HTMLCanvasElement, histogram: number[]): void {
  const context = canvas.getContext('2d');
  if (!context) return;
  context.clearRect(0, 0, canvas.width, canvas.height);
  // Square roots: a wall of one gray would hide everything else.
  const most = Math.sqrt(Math.max(1, ...histogram));
  const width = canvas.width / histogram.length;
  histogram.forEach((count, i) => {
    const height = (Math.sqrt(count) / most) * canvas.height;
    context.fillStyle = i === 0 || i === histogram.length - 1 ? '#f0b44c' : '#8cc8ff';
    context.fillRect(i * width, canvas.height - height, Math.max(1, width - 1), height);
  });
}
