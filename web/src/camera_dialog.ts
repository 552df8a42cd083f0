import { element, setText } from './dom';
import { duration, fixed } from './format';
import { draw, drawHistogram, KIND_STYLE, outlineAt, type Shown } from './view_canvas';
import { OUTLINE_KINDS, type CameraInfo, type Outline, type OutlineKind, type PictureRequest } from './view_protocol';
import { exposureVerdict, KIND_WORD, outlineWords, rateVerdict, sharpnessVerdict, sizeVerdict, type Verdict } from './view_words';

const SHARP_FROM_PX = 1280;
const POINT_AT_ONE = 'Point at an outline, or go through them with the arrow keys.';

const SAME_SQUARE_PX = 8;

function sameSquare(one: Outline, outlines: Outline[]): Outline | null {
  const off = (other: Outline) => Math.hypot((other.px[0] ?? 0) - (one.px[0] ?? 0), (other.px[1] ?? 0) - (one.px[1] ?? 0));
  return outlines.find((other) => other.kind === one.kind && other.id === null && off(other) < SAME_SQUARE_PX) ?? null;
}

/** One camera, large: outlines to point at, exposure, sharpness, with remedies. */
export class CameraDialog {
  private readonly dialog = element('dialog', 'camera-view');
  private readonly title = element('h2');
  private readonly facts = element('p', 'facts');
  private readonly canvas = element('canvas');
  private readonly words = element('p', 'pointed', POINT_AT_ONE);
  private readonly verdicts = element('ul', 'verdicts');
  private readonly histogram = element('canvas', 'histogram');
  private readonly grays = element('p', 'facts');
  private readonly counts = new Map<OutlineKind, HTMLButtonElement>();
  private readonly full = element('button', '', 'Full size');
  private readonly kinds = new Set<OutlineKind>(OUTLINE_KINDS);
  private camera: CameraInfo | null = null;
  private shown: Shown | null = null;
  private chosen: Outline | null = null;
  private isPinned = false;

  /** @param changed  the request has changed */
  constructor(private readonly changed: () => void) {
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    this.words.setAttribute('role', 'status');
    this.histogram.width = 256;
    this.histogram.height = 64;
    this.histogram.setAttribute('role', 'img');
    const close = element('button', 'close', 'Close');
    close.type = this.full.type = 'button';
    close.addEventListener('click', () => this.dialog.close());
    this.full.setAttribute('aria-pressed', 'false');
    this.full.title = 'Ask for every pixel; costs more of the network';
    this.full.addEventListener('click', () => {
      this.full.setAttribute('aria-pressed', String(!this.isFull()));
      this.changed();
    });
    const head = element('div', 'view-head');
    head.append(this.title, this.facts, this.full, close);
    const measures = element('div', 'measures');
    measures.append(this.verdicts, this.histogram, this.grays);
    const stage = element('div', 'view-stage');
    stage.append(this.canvas);
    this.dialog.append(head, stage, this.switches(), this.words, measures);
    this.dialog.addEventListener('close', () => {
      this.camera = null;
      this.show(null);
      this.changed();
    });
    this.listen();
    document.body.append(this.dialog);
  }

  open(camera: CameraInfo, name: string, last: Shown | null): void {
    this.camera = camera;
    this.chosen = null;
    this.isPinned = false;
    // A small image is drawn enlarged, so that outlines and names on it are fine.
    const enlarged = Math.max(1, Math.ceil(SHARP_FROM_PX / Math.max(1, camera.width)));
    this.canvas.width = enlarged * Math.max(1, camera.width);
    this.canvas.height = enlarged * Math.max(1, camera.height);
    this.canvas.setAttribute('aria-label', `Picture of ${name}`);
    setText(this.title, name);
    setText(this.words, POINT_AT_ONE);
    this.dialog.showModal();
    this.show(last);
    this.changed();
  }

  /** The pictures that it needs; null: it is closed. */
  request(): PictureRequest | null {
    if (!this.camera) return null;
    const shown = Math.ceil(this.canvas.clientWidth * Math.min(2, window.devicePixelRatio || 1));
    const width = this.isFull() ? this.camera.width : Math.min(this.camera.width, Math.max(640, Math.min(shown, 960)));
    return {
      body: this.camera.body,
      camera: this.camera.camera,
      width: Math.min(4096, Math.max(80, width)),
      perSecond: 10,
      candidates: this.kinds.has('candidate'),
    };
  }

  /** Of any camera; only its own is drawn. */
  receive(shown: Shown): void {
    const { view } = shown;
    if (this.camera?.body !== view.body || this.camera.camera !== view.camera) return;
    this.chosen = this.again(shown);
    this.show(shown);
  }

  showAge(ageMs: number | null, stale: boolean): void {
    this.dialog.classList.toggle('stale', stale);
    const { value, unit } = duration(ageMs);
    const view = this.shown?.view;
    const size = view ? `${view.width} × ${view.height} · ` : '';
    setText(this.facts, ageMs === null ? 'Waiting for a picture …' : `${size}${stale ? 'no new picture since' : ''} ${value} ${unit}${stale ? '' : ' old'}`);
  }

  private isFull(): boolean {
    return this.full.getAttribute('aria-pressed') === 'true';
  }

  private switches(): HTMLElement {
    const made = element('div', 'kinds');
    made.setAttribute('role', 'group');
    made.setAttribute('aria-label', 'Outlines shown');
    for (const kind of OUTLINE_KINDS) {
      const button = element('button', '', KIND_WORD[kind]);
      button.type = 'button';
      button.dataset.kind = kind;
      button.style.setProperty('--kind', KIND_STYLE[kind].colour);
      button.setAttribute('aria-pressed', 'true');
      button.addEventListener('click', () => this.toggle(kind));
      this.counts.set(kind, button);
      made.append(button);
    }
    return made;
  }

  private toggle(kind: OutlineKind): void {
    if (!this.kinds.delete(kind)) this.kinds.add(kind);
    this.counts.get(kind)?.setAttribute('aria-pressed', String(this.kinds.has(kind)));
    this.redraw();
    this.changed();
  }

  private listen(): void {
    const at = (event: MouseEvent): Outline | null => {
      if (!this.shown) return null;
      const box = this.canvas.getBoundingClientRect();
      const scale = this.shown.view.width / Math.max(1, box.width);
      return outlineAt(this.shown.view, (event.clientX - box.left) * scale - 0.5, (event.clientY - box.top) * scale - 0.5, this.kinds);
    };
    this.canvas.addEventListener('pointermove', (event) => {
      if (!this.isPinned) this.choose(at(event));
    });
    this.canvas.addEventListener('click', (event) => {
      const hit = at(event);
      this.isPinned = hit !== null;
      this.choose(hit);
    });
    this.canvas.addEventListener('keydown', (event) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      const all = (this.shown?.view.outlines ?? []).filter((outline) => this.kinds.has(outline.kind));
      if (all.length === 0) return;
      const next = (this.chosen ? all.indexOf(this.chosen) : step > 0 ? -1 : 0) + step;
      this.isPinned = true;
      this.choose(all[(next + all.length) % all.length] ?? null);
    });
  }

  private choose(outline: Outline | null): void {
    if (outline === this.chosen) return;
    this.chosen = outline;
    setText(this.words, outline ? outlineWords(outline) : POINT_AT_ONE);
    this.redraw();
  }

  /** The same tag in the next picture, where there is one; of a square without an id, that in its place. */
  private again(shown: Shown): Outline | null {
    const { chosen } = this;
    if (!chosen) return null;
    if (chosen.id === null) return this.kinds.has(chosen.kind) ? sameSquare(chosen, shown.view.outlines) : null;
    const same = shown.view.outlines.filter((outline) => outline.id === chosen.id && this.kinds.has(outline.kind));
    const found = same.find((outline) => outline.kind === chosen.kind) ?? same[0] ?? null;
    setText(this.words, found ? outlineWords(found) : `Tag ${chosen.id} is not in this picture.`);
    return found ?? chosen;
  }

  private show(shown: Shown | null): void {
    this.shown = shown;
    this.redraw();
    const view = shown?.view;
    for (const [kind, button] of this.counts) {
      const number = view?.outlines.filter((outline) => outline.kind === kind).length ?? 0;
      setText(button, `${KIND_WORD[kind]} ${number}`);
    }
    if (!view) return;
    const all = [exposureVerdict(view), sharpnessVerdict(view), sizeVerdict(view), rateVerdict(view, this.camera?.rateHz ?? 0)];
    this.verdicts.replaceChildren(...all.filter((verdict) => verdict.text !== '').map(verdictLine));
    const e = view.exposure;
    this.histogram.hidden = this.grays.hidden = !e;
    if (!e) return;
    drawHistogram(this.histogram, e.histogram);
    const grays = `Grays ${fixed(e.black, 0)} to ${fixed(e.white, 0)}, mean ${fixed(e.mean, 0)}, noise ${fixed(view.noise, 1)}`;
    this.histogram.setAttribute('aria-label', `Histogram. ${grays}`);
    setText(this.grays, grays);
  }

  private redraw(): void {
    if (this.shown) draw(this.canvas, this.shown, { kinds: this.kinds, chosen: this.chosen, labels: true });
    else this.canvas.getContext('2d')?.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }
}

export function verdictLine(verdict: Verdict): HTMLLIElement {
  const line = element('li', '', verdict.text);
  line.dataset.tone = verdict.tone;
  return line;
}
