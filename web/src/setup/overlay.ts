import type { Lens, Picture, TagOutline } from './protocol';

const GREEN = '#4fd08b';
const AMBER = '#f0b44c';
const LABEL_FROM_PX = 30; // of the screen: smaller tags would hide behind their names
const COVERED = 2;

export interface Drawn {
  bitmap: ImageBitmap | null;
  picture: Picture | null;
  /** null: no coverage is shown. */
  lens: Lens | null;
}

/** The picture, cells that are covered over it, and outlines of tags on top. */
export function drawPicture(canvas: HTMLCanvasElement, { bitmap, picture, lens }: Drawn): void {
  const context = canvas.getContext('2d');
  if (!context) return;
  const width = picture?.width ?? bitmap?.width ?? 640;
  const height = picture?.height ?? bitmap?.height ?? 400;
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
  context.fillStyle = '#182129';
  context.fillRect(0, 0, width, height);
  if (bitmap) context.drawImage(bitmap, 0, 0, width, height);
  const ratio = width / Math.max(1, canvas.clientWidth);
  if (lens) drawCoverage(context, lens, ratio);
  for (const outline of picture?.outlines ?? []) drawOutline(context, outline, ratio);
}

/** Green: covered; amber: once more; a line only: nothing yet. */
function drawCoverage(context: CanvasRenderingContext2D, lens: Lens, ratio: number): void {
  const { width, height } = context.canvas;
  const [w, h] = [width / lens.columns, height / lens.rows];
  lens.points.forEach((points, i) => {
    const [x, y] = [(i % lens.columns) * w, Math.floor(i / lens.columns) * h];
    if (points > 0) {
      context.fillStyle = points >= COVERED ? GREEN : AMBER;
      context.globalAlpha = points >= COVERED ? 0.32 : 0.2;
      context.fillRect(x, y, w, h);
      context.globalAlpha = 1;
    }
    context.lineWidth = ratio;
    context.strokeStyle = 'rgb(232 238 243 / 0.35)';
    context.strokeRect(x, y, w, h);
    if (points >= COVERED) tick(context, x + w - 13 * ratio, y + h - 12 * ratio, ratio);
  });
}

/** For people who do not see colours. */
function tick(context: CanvasRenderingContext2D, x: number, y: number, ratio: number): void {
  context.beginPath();
  context.moveTo(x - 5 * ratio, y);
  context.lineTo(x - ratio, y + 4 * ratio);
  context.lineTo(x + 6 * ratio, y - 5 * ratio);
  context.lineWidth = 2.5 * ratio;
  context.strokeStyle = GREEN;
  context.stroke();
}

function drawOutline(
  context: CanvasRenderingContext2D,
  outline: TagOutline,
  ratio: number,
): void {
  context.beginPath();
  // The centre of the first pixel is half a pixel from the edge.
  for (const [u, v] of outline.corners) context.lineTo(u + 0.5, v + 0.5);
  context.closePath();
  context.lineWidth = 2 * ratio;
  context.strokeStyle = '#8cc8ff';
  context.stroke();
  const [xs, ys] = [outline.corners.map(([u]) => u), outline.corners.map(([, v]) => v)];
  if (Math.max(...xs) - Math.min(...xs) < LABEL_FROM_PX * ratio) return;
  const mean = (values: number[]): number => values.reduce((sum, x) => sum + x, 0) / values.length;
  label(context, String(outline.id), mean(xs), mean(ys), ratio);
}

function label(
  context: CanvasRenderingContext2D,
  words: string,
  x: number,
  y: number,
  ratio: number,
): void {
  context.font = `600 ${14 * ratio}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  const width = context.measureText(words).width + 10 * ratio;
  context.fillStyle = 'rgb(11 15 19 / 0.82)';
  context.fillRect(x - width / 2, y - 10 * ratio, width, 20 * ratio);
  context.fillStyle = '#8cc8ff';
  context.fillText(words, x, y + ratio);
}

/** Text of the canvas for screen readers. */
export function pictureWords({ picture, lens }: Pick<Drawn, 'picture' | 'lens'>): string {
  if (!picture) return 'No picture yet.';
  const ids = picture.outlines.map((outline) => outline.id).sort((a, b) => a - b);
  const tags = ids.length === 0 ? 'No tag is seen' : `Tags seen: ${ids.join(', ')}`;
  const covered = lens ? ` ${Math.round(100 * lens.covered)} % of the image is covered.` : '';
  return `Live picture. ${tags}.${covered}`;
}
