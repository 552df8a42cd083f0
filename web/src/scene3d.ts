import { Color, DirectionalLight, HemisphereLight, Scene, SRGBColorSpace, Vector2, Vector3, WebGLRenderer } from 'three';
import { BodyView, type Box } from './body_view';
import { CameraRig } from './camera_rig';
import { element } from './dom';
import type { BodyFrame, BodyName, MapTag, TagChange } from './protocol';
import { EMPTY_ROOM, extentOf, RoomView, sameExtent, type Extent } from './room_view';
import { ChangesView } from './changes_view';
import { TagsView } from './tags_view';
import { fitSprites } from './text_sprite';
import { bodyColour, ROOM } from './theme';

const FRAME_MS = 1000 / 30; // smooth enough for robots, half the work of a screen's own rate
const SIGMA_SCALES = [0, 1, 10, 100] as const;
const SHARPEST = 2;
const KEY_TURN = 0.12;
const NARROW_PX = 600;
const CLICK_PX = 5; // a finger is not steady

/** The room in three dimensions. Draws only while something moves. */
export class Scene3D {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly rig: CameraRig;
  private readonly room = new RoomView();
  private readonly tags = new TagsView();
  private readonly changes = new ChangesView();
  private readonly labels = element('div', 'labels');
  private readonly bodies = new Map<number, BodyView>();
  private extent: Extent = EMPTY_ROOM;
  private tagPoints: [number, number, number][] = [];
  private chosen: number | null = null;
  private sigma: number = 10;
  private width = 1;
  private height = 1;
  private frameAt = 0;
  private framePeriod = 50;
  private drawnAt = 0;
  private wanted = false;

  /** Throws when the browser has no WebGL. @param pointed  called with the clicked tag */
  constructor(
    private readonly host: HTMLElement,
    private readonly reducedMotion: boolean,
    pointed: (tag: number) => void,
  ) {
    this.renderer = new WebGLRenderer({ antialias: true, powerPreference: 'low-power' });
    this.renderer.outputColorSpace = SRGBColorSpace;
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', 'The room with its tags and bodies. Arrow keys turn the view, plus and minus zoom.');
    this.labels.setAttribute('aria-hidden', 'true');
    host.append(canvas, this.labels);
    this.rig = new CameraRig(canvas, reducedMotion, () => this.draw());
    this.scene.background = new Color(ROOM.background);
    const sun = new DirectionalLight('#ffffff', 2.2);
    sun.position.set(-3, -5, 9);
    this.scene.add(new HemisphereLight('#dfe9f2', '#3a4650', 1.6), sun);
    this.scene.add(this.room.group, this.tags.group, this.changes.group);
    this.tags.setSigmaScale(this.sigma);
    canvas.addEventListener('keydown', (event) => this.key(event));
    this.wirePointing(canvas, pointed);
    new ResizeObserver(() => this.resize()).observe(host);
    this.resize();
    this.rig.show(this.landmarks(), 'oblique', null);
  }

  setBodies(bodies: BodyName[]): void {
    for (const view of this.bodies.values()) {
      this.scene.remove(view.group);
      view.dispose();
    }
    this.bodies.clear();
    bodies.forEach((body, place) => {
      const view = new BodyView(body.name, bodyColour(place));
      view.setSigmaScale(this.sigma);
      view.trail.resize(this.width, this.height);
      this.bodies.set(body.id, view);
      this.scene.add(view.group);
      this.labels.append(view.label);
    });
    this.rig.follow(null, 0);
  }

  /** Arrows from former to present places of tags. */
  setChanges(changes: TagChange[]): void {
    this.changes.set(changes);
    this.draw();
  }

  /** A frame around this tag; null: around none. */
  chooseTag(id: number | null): void {
    this.tags.choose(id);
    this.draw();
  }

  setMap(tags: MapTag[]): void {
    this.tags.set(tags);
    this.tagPoints = tags.map((tag) => tag.p);
    fitSprites(this.tags.group, this.rig.camera, this.height);
    this.grow(this.tagPoints);
    this.draw();
  }

  /** @param periodMs  how long until the next one, about */
  setFrame(bodies: BodyFrame[], periodMs: number): void {
    this.frameAt = performance.now();
    this.framePeriod = this.reducedMotion ? 0 : periodMs;
    for (const body of bodies) this.bodies.get(body.id)?.set(body);
    const poses = bodies.flatMap((body) => (body.valid && body.pose ? [body.pose.p] : []));
    if (poses.some((p) => this.isOutside(p))) this.grow([...this.tagPoints, ...poses]);
    this.draw();
  }

  choose(id: number | null): void {
    this.chosen = id;
    if (this.rig.following) this.follow(true);
  }

  showRoom(from: 'oblique' | 'top'): void {
    this.rig.show(this.landmarks(), from, performance.now());
    this.draw();
  }

  /** @returns whether it follows: there must be a body to follow. */
  follow(on: boolean): boolean {
    const id = this.chosen ?? [...this.bodies.keys()][0];
    const body = on && id !== undefined ? this.bodies.get(id) : undefined;
    this.rig.follow(body?.group.visible ? body.shown : null, performance.now());
    this.draw();
    return this.rig.following;
  }

  /** The next size of the ellipsoids. @returns the scale, 0 for none */
  nextSigmaScale(): number {
    const place = SIGMA_SCALES.findIndex((scale) => scale === this.sigma);
    this.sigma = SIGMA_SCALES[(place + 1) % SIGMA_SCALES.length] ?? 0;
    this.tags.setSigmaScale(this.sigma);
    for (const body of this.bodies.values()) body.setSigmaScale(this.sigma);
    this.draw();
    return this.sigma;
  }

  /** A click without rotation selects what is below it. */
  private wirePointing(canvas: HTMLCanvasElement, pointed: (tag: number) => void): void {
    let pressed: PointerEvent | null = null;
    canvas.addEventListener('pointerdown', (event) => (pressed = event));
    canvas.addEventListener('pointerup', (event) => {
      if (!pressed || Math.hypot(event.clientX - pressed.clientX, event.clientY - pressed.clientY) > CLICK_PX) return;
      const box = canvas.getBoundingClientRect();
      const at = new Vector2((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
      const tag = this.tags.at(at, this.rig.camera);
      if (tag !== null) pointed(tag);
    });
  }

  private isOutside([x, y, z]: readonly [number, number, number]): boolean {
    const { x0, x1, y0, y1, top } = this.extent;
    return x < x0 || x > x1 || y < y0 || y > y1 || z > top + 1;
  }

  /** Points that a view of the room must contain: the floor with its marks, and every tag. */
  private landmarks(): Vector3[] {
    const { x0, x1, y0, y1 } = this.extent;
    const right = x1 + (this.width < NARROW_PX ? 1.2 : 0.8);
    const floor = [
      [x0, y0 - 0.6],
      [x1, y0 - 0.6],
      [right, y0],
      [right, y1],
      [x0, y1],
    ].map(([x, y]) => new Vector3(x, y, 0));
    return [...floor, ...this.tagPoints.map(([x, y, z]) => new Vector3(x, y, z + 0.2))];
  }

  private grow(points: [number, number, number][]): void {
    const extent = extentOf(points);
    if (sameExtent(extent, this.extent)) return;
    this.extent = extent;
    this.room.set(extent, this.width < NARROW_PX);
    fitSprites(this.room.group, this.rig.camera, this.height);
    if (!this.rig.touched && !this.rig.following) this.rig.show(this.landmarks(), 'oblique', null);
  }

  private resize(): void {
    this.width = Math.max(1, this.host.clientWidth);
    this.height = Math.max(1, this.host.clientHeight);
    this.renderer.setPixelRatio(Math.min(SHARPEST, window.devicePixelRatio));
    this.renderer.setSize(this.width, this.height);
    this.rig.camera.aspect = this.width / this.height;
    this.rig.camera.updateProjectionMatrix();
    this.room.set(this.extent, this.width < NARROW_PX);
    this.tags.showLabels(this.width >= NARROW_PX);
    fitSprites(this.scene, this.rig.camera, this.height);
    for (const body of this.bodies.values()) body.trail.resize(this.width, this.height);
    if (!this.rig.touched && !this.rig.following) this.rig.show(this.landmarks(), 'oblique', null);
    // Another size empties the canvas: it would be blank until the next drawing.
    this.renderer.render(this.scene, this.rig.camera);
    this.draw();
  }

  private key(event: KeyboardEvent): void {
    const turns: Record<string, [number, number, number]> = {
      ArrowLeft: [-KEY_TURN, 0, 1],
      ArrowRight: [KEY_TURN, 0, 1],
      ArrowUp: [0, KEY_TURN, 1],
      ArrowDown: [0, -KEY_TURN, 1],
      '+': [0, 0, 1 / 1.15],
      '-': [0, 0, 1.15],
    };
    const turn = turns[event.key];
    if (!turn || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    this.rig.turn(...turn);
    this.draw();
  }

  /** Names beside their bodies; one that would cover another moves above it. */
  private placeLabels(): void {
    const taken: Box[] = [];
    for (const body of this.bodies.values()) {
      const box = body.labelBox(this.rig.camera, this.width, this.height);
      if (!box) continue;
      for (let blocker; (blocker = taken.find((other) => overlap(box, other))); ) box.y = blocker.y - box.height - 3;
      body.placeLabel(box);
      taken.push(box);
    }
  }

  /** Draws soon. */
  private draw(): void {
    if (this.wanted) return;
    this.wanted = true;
    requestAnimationFrame((at) => this.step(at));
  }

  private step(at: number): void {
    this.wanted = false;
    if (at - this.drawnAt < FRAME_MS - 4) return this.draw();
    this.drawnAt = at;
    const part = this.framePeriod > 0 ? Math.min(1, Math.max(0, (at - this.frameAt) / this.framePeriod)) : 1;
    for (const body of this.bodies.values()) body.move(part, this.rig.camera);
    const moving = this.rig.step(at);
    this.renderer.render(this.scene, this.rig.camera);
    this.placeLabels();
    if (moving || part < 1) this.draw();
  }
}

function overlap(a: Box, b: Box): boolean {
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}
