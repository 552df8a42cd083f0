import { Box3, PerspectiveCamera, Spherical, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const OBLIQUE = new Vector3(0.24, -0.9, 0.88).normalize();
// Not exactly down: up would not be defined.
const DOWN = new Vector3(0, -0.001, 1).normalize();
const FILLED_WIDTH = 0.95;
const FILLED_HEIGHT = 0.88;
// The buttons are at the upper edge: the middle of the picture is a little below that of the stage.
const BELOW_MIDDLE = 0.05;
const FLIGHT_MS = 450;
const FOLLOW_DISTANCE_M = 4.5;

interface Flight {
  startedAt: number;
  fromEye: Vector3;
  fromTarget: Vector3;
  toEye: Vector3;
  toTarget: Vector3;
}

/** The camera and how it moves: by hand, to a view, or along with a body. */
export class CameraRig {
  readonly camera = new PerspectiveCamera(38, 1, 0.05, 500);
  readonly controls: OrbitControls;
  /** True once the user has moved the camera: then it is not moved automatically any more. */
  touched = false;
  private flight: Flight | null = null;
  private followed: Vector3 | null = null;

  constructor(
    canvas: HTMLElement,
    private readonly reducedMotion: boolean,
    changed: () => void,
  ) {
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = !reducedMotion;
    this.controls.dampingFactor = 0.12;
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.controls.minDistance = 0.5;
    this.controls.maxDistance = 200;
    this.controls.addEventListener('change', changed);
    this.controls.addEventListener('start', () => {
      this.touched = true;
      this.flight = null;
      changed();
    });
  }

  get following(): boolean {
    return this.followed !== null;
  }

  /** All of `landmarks`, obliquely or from above. @param at  now, ms; null: at once */
  show(landmarks: Vector3[], from: 'oblique' | 'top', at: number | null): void {
    this.followed = null;
    const { target, eye } = this.framing(landmarks, from === 'top' ? DOWN : OBLIQUE);
    this.go(eye, target, at);
  }

  /** @param body  where it is drawn; read at every step. null: stay here */
  follow(body: Vector3 | null, at: number): void {
    this.followed = null;
    if (!body) return;
    const away = this.camera.position.clone().sub(this.controls.target);
    const distance = Math.min(away.length(), FOLLOW_DISTANCE_M);
    this.go(body.clone().addScaledVector(away.normalize(), distance), body.clone(), at);
    this.followed = body;
  }

  /** Around the target by hand. @param zoom  distance × this */
  turn(azimuth: number, elevation: number, zoom: number): void {
    this.touched = true;
    this.flight = null;
    const away = new Spherical().setFromVector3(toYUp(this.camera.position.clone().sub(this.controls.target)));
    away.theta += azimuth;
    away.phi = Math.min(this.controls.maxPolarAngle, Math.max(0.01, away.phi - elevation));
    away.radius = Math.min(this.controls.maxDistance, Math.max(this.controls.minDistance, away.radius * zoom));
    this.camera.position.copy(toZUp(new Vector3().setFromSpherical(away))).add(this.controls.target);
  }

  /** @returns true while the camera still moves. */
  step(at: number): boolean {
    if (this.flight) this.fly(this.flight, at);
    else if (this.followed) {
      const moved = this.followed.clone().sub(this.controls.target);
      this.controls.target.add(moved);
      this.camera.position.add(moved);
    }
    const drifting = this.controls.update();
    return this.flight !== null || (drifting && !this.reducedMotion);
  }

  private go(eye: Vector3, target: Vector3, at: number | null): void {
    if (at === null || this.reducedMotion) {
      this.flight = null;
      this.camera.position.copy(eye);
      this.controls.target.copy(target);
      this.controls.update();
      return;
    }
    const fromEye = this.camera.position.clone();
    this.flight = { startedAt: at, fromEye, fromTarget: this.controls.target.clone(), toEye: eye, toTarget: target };
  }

  private fly(flight: Flight, at: number): void {
    const part = Math.min(1, Math.max(0, (at - flight.startedAt) / FLIGHT_MS));
    const eased = part * part * (3 - 2 * part);
    // A followed body moves while the camera approaches it.
    const shift = this.followed ? this.followed.clone().sub(flight.toTarget) : new Vector3();
    this.camera.position.lerpVectors(flight.fromEye, flight.toEye.clone().add(shift), eased);
    this.controls.target.lerpVectors(flight.fromTarget, flight.toTarget.clone().add(shift), eased);
    if (part === 1) this.flight = null;
  }

  /** The nearest eye in this direction that sees all landmarks, found by halving, with their middle in the middle. */
  private framing(landmarks: Vector3[], direction: Vector3): { target: Vector3; eye: Vector3 } {
    const target = new Box3().setFromPoints(landmarks).getCenter(new Vector3());
    const probe = this.camera.clone();
    const place = (distance: number): void => {
      probe.position.copy(target).addScaledVector(direction, distance);
      probe.lookAt(target);
      probe.updateMatrixWorld();
    };
    const bounds = (): { x: [number, number]; y: [number, number] } => {
      const seen = landmarks.map((landmark) => landmark.clone().project(probe));
      const xs = seen.map((p) => p.x);
      const ys = seen.map((p) => p.y);
      return { x: [Math.min(...xs), Math.max(...xs)], y: [Math.min(...ys), Math.max(...ys)] };
    };
    let near = 1;
    let far = 200;
    for (let i = 0; i < 24; ++i) {
      const middle = (near + far) / 2;
      place(middle);
      // Move the target so that the picture is in the middle, then ask whether it fits.
      const { x, y } = bounds();
      const reach = middle * Math.tan((probe.fov * Math.PI) / 360);
      const right = new Vector3().setFromMatrixColumn(probe.matrixWorld, 0);
      const up = new Vector3().setFromMatrixColumn(probe.matrixWorld, 1);
      target.addScaledVector(right, ((x[0] + x[1]) / 2) * reach * probe.aspect * 0.5);
      target.addScaledVector(up, ((y[0] + y[1]) / 2 + BELOW_MIDDLE) * reach * 0.5);
      const fits = x[1] - x[0] < 2 * FILLED_WIDTH && y[1] - y[0] < 2 * FILLED_HEIGHT;
      if (fits) far = middle;
      else near = middle;
    }
    place(far);
    return { target, eye: probe.position.clone() };
  }
}

// In Spherical y is up.
function toYUp(v: Vector3): Vector3 {
  return new Vector3(v.x, v.z, -v.y);
}

function toZUp(v: Vector3): Vector3 {
  return new Vector3(v.x, -v.z, v.y);
}
