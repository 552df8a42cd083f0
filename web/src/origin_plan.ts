import type { Origin } from './origin';
import { turnTowards } from './origin';
import type { MapTag } from './protocol';

const SVG = 'http://www.w3.org/2000/svg';
const SIZE = 100; // of the drawing, its own units; the page scales it
const MARGIN = 9;
const ARROW = 16;
const REACH = 3.4; // around a tag, to click at
const STILL_PX = 3;
const LEAST_M = 1; // across, also when all tags are close together

function made<K extends keyof SVGElementTagNameMap>(
  kind: K,
  attributes: Record<string, string | number>,
  text = '',
): SVGElementTagNameMap[K] {
  const node = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, String(value));
  if (text) node.textContent = text;
  return node;
}

/** The tags from above, and the origin, which is dragged; so is the tip of its x axis. */
export class OriginPlan {
  readonly svg = made('svg', { viewBox: `0 0 ${SIZE} ${SIZE}`, class: 'plan' });
  private readonly axes = made('g', { class: 'plan-axes' });
  private readonly perMetre: number;
  private readonly left: number;
  private readonly low: number;
  private origin: Origin;

  /**
   * @param dragged  called with the origin while it is dragged
   * @param pointed  called with the clicked tag
   */
  constructor(
    private readonly tags: readonly MapTag[],
    origin: Origin,
    private readonly dragged: (origin: Origin) => void,
    private readonly pointed: (tag: MapTag) => void,
  ) {
    this.origin = origin;
    const xs = [origin.x, ...tags.map((tag) => tag.p[0])];
    const ys = [origin.y, ...tags.map((tag) => tag.p[1])];
    const [x0, x1] = [Math.min(...xs), Math.max(...xs)];
    const [y0, y1] = [Math.min(...ys), Math.max(...ys)];
    const across = Math.max(x1 - x0, y1 - y0, LEAST_M);
    this.perMetre = (SIZE - 2 * MARGIN) / across;
    this.left = (x0 + x1 - across) / 2;
    this.low = (y0 + y1 - across) / 2;
    this.svg.setAttribute('role', 'img');
    this.svg.setAttribute('aria-label', 'The map from above: drag the origin, or the tip of its x axis; or click at tags.');
    for (const tag of tags) this.svg.append(this.tagMark(tag));
    this.svg.append(this.axes);
    this.show(origin);
  }

  show(origin: Origin): void {
    this.origin = origin;
    const [x, y] = this.at(origin.x, origin.y);
    const turn = (origin.turn * Math.PI) / 180;
    const tip = (length: number, angle: number): [number, number] => [
      x + length * Math.cos(angle),
      y - length * Math.sin(angle),
    ];
    const [xx, xy] = tip(ARROW, turn);
    const [yx, yy] = tip(0.6 * ARROW, turn + Math.PI / 2);
    const middle = made('circle', { class: 'plan-origin', cx: x, cy: y, r: 2.6 });
    const end = made('circle', { class: 'plan-tip', cx: xx, cy: xy, r: 2.2 });
    this.makeDraggable(middle, (px, py) => ({ ...this.origin, ...this.metres(px, py) }));
    this.makeDraggable(end, (px, py) => {
      const { x: to_x, y: to_y } = this.metres(px, py);
      return { ...this.origin, turn: turnTowards(this.origin, [to_x, to_y]) ?? this.origin.turn };
    });
    this.axes.replaceChildren(
      made('line', { class: 'plan-y', x1: x, y1: y, x2: yx, y2: yy }),
      made('line', { class: 'plan-x', x1: x, y1: y, x2: xx, y2: xy }),
      made('text', { x: xx + 2.5, y: xy - 1.5, class: 'plan-x' }, 'x'),
      made('text', { x: yx + 1, y: yy - 1, class: 'plan-y' }, 'y'),
      middle,
      end,
    );
  }

  private tagMark(tag: MapTag): SVGGElement {
    const [x, y] = this.at(tag.p[0], tag.p[1]);
    const mark = made('g', { class: 'plan-tag', 'data-tag': tag.id });
    mark.append(
      made('title', {}, `tag ${tag.id}, ${tag.p[2].toFixed(2)} m high`),
      made('circle', { cx: x, cy: y, r: REACH, class: 'plan-reach' }),
      made('rect', { x: x - 1.1, y: y - 1.1, width: 2.2, height: 2.2 }),
      made('text', { x: x + 1.8, y: y + 1.2 }, String(tag.id)),
    );
    mark.addEventListener('click', () => this.pointed(tag));
    return mark;
  }

  /**
   * The handle is drawn again while it moves, so the pointer is followed on the drawing. Pressed without
   * being moved, it selects what is below it.
   */
  private makeDraggable(handle: SVGElement, moved: (x: number, y: number) => Origin): void {
    handle.addEventListener('pointerdown', (down) => {
      down.preventDefault();
      let isMoved = false;
      const follow = (event: PointerEvent): void => {
        isMoved ||= Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) > STILL_PX;
        const place = this.placeOf(event);
        if (!place || !isMoved) return;
        this.show(moved(place.x, place.y));
        this.dragged(this.origin);
      };
      const end = (event: PointerEvent): void => {
        window.removeEventListener('pointermove', follow);
        window.removeEventListener('pointerup', end);
        window.removeEventListener('pointercancel', end);
        if (!isMoved && event.type === 'pointerup') this.pointBelow(event);
      };
      window.addEventListener('pointermove', follow);
      window.addEventListener('pointerup', end);
      window.addEventListener('pointercancel', end);
    });
  }

  private pointBelow(event: PointerEvent): void {
    const place = this.placeOf(event);
    if (!place) return;
    const away = (tag: MapTag): number => {
      const [x, y] = this.at(tag.p[0], tag.p[1]);
      return Math.hypot(x - place.x, y - place.y);
    };
    const [nearest] = [...this.tags].sort((a, b) => away(a) - away(b));
    if (nearest && away(nearest) < REACH) this.pointed(nearest);
  }

  private placeOf(event: PointerEvent): DOMPoint | null {
    const onPage = this.svg.getScreenCTM();
    return onPage ? new DOMPoint(event.clientX, event.clientY).matrixTransform(onPage.inverse()) : null;
  }

  private at(x: number, y: number): [number, number] {
    return [MARGIN + (x - this.left) * this.perMetre, SIZE - MARGIN - (y - this.low) * this.perMetre];
  }

  private metres(x: number, y: number): { x: number; y: number } {
    return { x: this.left + (x - MARGIN) / this.perMetre, y: this.low + (SIZE - MARGIN - y) / this.perMetre };
  }
}
