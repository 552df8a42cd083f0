import { CameraDialog } from './camera_dialog';
import { element, setText } from './dom';
import { duration, fixed } from './format';
import { draw, type Shown } from './view_canvas';
import { ViewLink, viewsUrl } from './view_link';
import type { CameraInfo, OutlineKind, ViewList, ViewPicture, PictureRequest } from './view_protocol';
import { exposureVerdict, rateVerdict, sharpnessVerdict, worstOf } from './view_words';

const TILE_WIDTH_PX = 320;
const TILE_PER_SECOND = 2;
const STALE_MS = 2500;
const LOOK_MS = 250;
const TILE_KINDS: ReadonlySet<OutlineKind> = new Set<OutlineKind>(['used', 'rejected']);

interface Tile {
  camera: CameraInfo;
  button: HTMLButtonElement;
  canvas: HTMLCanvasElement;
  name: HTMLElement;
  facts: HTMLElement;
  verdict: HTMLElement;
  shown: Shown | null;
  isVisible: boolean;
}

/** All cameras, small; one at a time large. Requests only pictures that are visible. */
export class CamerasPanel {
  private readonly notice = element('p', 'empty');
  private readonly grid = element('div', 'tiles');
  private readonly dialog = new CameraDialog(() => this.requestAgain());
  private readonly link: ViewLink;
  private readonly watcher = new IntersectionObserver((seen) => this.sawTiles(seen));
  private tiles: Tile[] = [];
  private names = new Map<number, string>();
  private list: ViewList | null = null;
  private isOpen = false;
  private serverMs: { utc: number; at: number } | null = null;

  /** @param page  its address   @param token  of the operator, once it is known   @param unlock  shows its field */
  constructor(
    private readonly host: HTMLElement,
    page: string,
    private readonly token: () => string | null,
    unlock: () => void,
  ) {
    this.link = new ViewLink(
      viewsUrl(page),
      { picture: (picture) => void this.receive(picture), trouble: (words) => this.say(words) },
      () => (this.list?.access === 'proof' ? this.token() : null),
    );
    const open = element('button', 'unlock', 'Unlock');
    open.type = 'button';
    open.addEventListener('click', unlock);
    host.append(this.notice, open, this.grid);
    document.addEventListener('visibilitychange', () => this.requestAgain());
    setInterval(() => this.showAges(), LOOK_MS);
  }

  setBodies(bodies: { id: number; name: string }[]): void {
    this.names = new Map(bodies.map(({ id, name }) => [id, name]));
    for (const tile of this.tiles) this.name(tile);
  }

  /** @param utcMs  of the newest frame, by the server's clock */
  setTime(utcMs: number): void {
    this.serverMs = { utc: utcMs, at: performance.now() };
  }

  /** The panel is shown, or not any more. */
  show(isOpen: boolean): void {
    this.isOpen = isOpen;
    if (isOpen) void this.refresh();
    else this.requestAgain();
  }

  /** A new connection, perhaps to another server; or the token has become known. */
  restart(): void {
    if (this.isOpen) void this.refresh();
  }

  private async refresh(): Promise<void> {
    const list = await this.link.list();
    if (!list) return this.say('The server does not list its cameras.');
    const isSame = JSON.stringify(list.cameras) === JSON.stringify(this.list?.cameras);
    this.list = list;
    if (!isSame) this.build(list.cameras);
    const locked = list.access === 'proof' && this.token() === null;
    this.host.classList.toggle('locked', locked);
    this.say(list.access === 'denied' ? sentence(list.why) : locked ? `${sentence(list.why)} Unlock with it under “Map”.` : '');
    this.requestAgain();
  }

  private say(words: string): void {
    const isEmpty = this.list?.access === 'granted' && this.tiles.length === 0;
    setText(this.notice, words || (isEmpty ? 'No body has a camera.' : ''));
    this.notice.hidden = this.notice.textContent === '';
  }

  private build(cameras: CameraInfo[]): void {
    this.watcher.disconnect();
    this.tiles = cameras.map((camera) => this.tile(camera));
    this.grid.replaceChildren(...this.tiles.map((tile) => tile.button));
    for (const tile of this.tiles) this.watcher.observe(tile.button);
  }

  private tile(camera: CameraInfo): Tile {
    const button = element('button', 'camera');
    button.type = 'button';
    button.dataset.camera = `${camera.body}/${camera.camera}`;
    const canvas = element('canvas');
    canvas.width = TILE_WIDTH_PX;
    canvas.height = Math.round((TILE_WIDTH_PX * Math.max(1, camera.height)) / Math.max(1, camera.width));
    canvas.setAttribute('aria-hidden', 'true');
    const tile: Tile = {
      camera,
      button,
      canvas,
      name: element('span', 'name'),
      facts: element('span', 'facts'),
      verdict: element('span', 'verdict'),
      shown: null,
      isVisible: false,
    };
    button.append(canvas, tile.name, tile.facts, tile.verdict);
    button.addEventListener('click', () => this.dialog.open(camera, this.nameOf(camera), tile.shown));
    this.name(tile);
    return tile;
  }

  private nameOf({ body, camera }: CameraInfo): string {
    const name = this.names.get(body) ?? `Body ${body}`;
    const several = this.tiles.filter((tile) => tile.camera.body === body).length > 1 || camera > 0;
    return several ? `${name}, camera ${camera + 1}` : name;
  }

  private name(tile: Tile): void {
    const name = this.nameOf(tile.camera);
    setText(tile.name, name);
    tile.button.title = `Show the picture of ${name} large`;
  }

  private sawTiles(seen: IntersectionObserverEntry[]): void {
    for (const { target, isIntersecting } of seen) {
      const tile = this.tiles.find(({ button }) => button === target);
      if (tile) tile.isVisible = isIntersecting;
    }
    this.requestAgain();
  }

  private requestAgain(): void {
    this.link.request(this.requests());
  }

  private requests(): PictureRequest[] {
    const mayLook = this.list && this.list.access !== 'denied' && !this.host.classList.contains('locked');
    if (!mayLook || document.hidden) return [];
    const large = this.dialog.request();
    if (large) return [large]; // it covers the tiles
    if (!this.isOpen) return [];
    return this.tiles
      .filter((tile) => tile.isVisible)
      .slice(0, 16)
      .map(({ camera }) => ({ body: camera.body, camera: camera.camera, width: TILE_WIDTH_PX, perSecond: TILE_PER_SECOND, candidates: false }));
  }

  private async receive({ view, jpeg }: ViewPicture): Promise<void> {
    const tile = this.tiles.find(({ camera }) => camera.body === view.body && camera.camera === view.camera);
    if (!tile) return;
    const bitmap = jpeg.length > 0 ? await createImageBitmap(new Blob([jpeg], { type: 'image/jpeg' })).catch(() => null) : null;
    if (tile.shown && tile.shown.view.utcMs > view.utcMs) return bitmap?.close(); // overtaken
    const before = tile.shown;
    tile.shown = { view, bitmap };
    before?.bitmap?.close();
    draw(tile.canvas, tile.shown, { kinds: TILE_KINDS, chosen: null, labels: false });
    const worst = worstOf([exposureVerdict(view), sharpnessVerdict(view), rateVerdict(view, tile.camera.rateHz)]);
    setText(tile.verdict, worst.text);
    tile.verdict.dataset.tone = worst.tone;
    this.dialog.receive(tile.shown);
    this.showAge(tile);
  }

  private ageOf(tile: Tile): number | null {
    if (!tile.shown || !this.serverMs) return null;
    return Math.max(0, this.serverMs.utc + performance.now() - this.serverMs.at - tile.shown.view.utcMs);
  }

  private showAges(): void {
    if (!this.isOpen && !this.dialog.request()) return;
    for (const tile of this.tiles) this.showAge(tile);
  }

  private showAge(tile: Tile): void {
    const age = this.ageOf(tile);
    const stale = age !== null && age > STALE_MS;
    tile.button.classList.toggle('stale', stale);
    const { value, unit } = duration(age);
    const tags = tile.shown?.view.outlines.filter(({ kind }) => kind === 'used').length ?? 0;
    const live = `${fixed(tile.shown?.view.rateHz ?? null, 0)} Hz · ${tags} used`;
    setText(tile.facts, age === null ? 'no picture yet' : stale ? `${value} ${unit} old` : live);
    const request = this.dialog.request();
    if (request && request.body === tile.camera.body && request.camera === tile.camera.camera) this.dialog.showAge(age, stale);
  }
}

/** As a sentence. */
function sentence(words: string): string {
  return `${words.charAt(0).toUpperCase()}${words.slice(1)}.`;
}
