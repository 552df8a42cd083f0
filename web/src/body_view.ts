import {
  BufferGeometry,
  Color,
  type Camera,
  Float32BufferAttribute,
  Group,
  Line,
  LineBasicMaterial,
  LineSegments,

  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  Quaternion,
  RingGeometry,
  SphereGeometry,
  Vector3,
} from 'three';
import { element, setText } from './dom';
import type { BodyFrame } from './protocol';
import { ellipsoidMatrix } from './tags_view';
import { ROOM, STATE_WORD } from './theme';
import { Trail } from './trail';

// A marker is at least this large, and at least this part of its distance: legible from across the lab.
const SMALLEST_M = 0.25;
const PART_OF_DISTANCE = 0.042;
const ABOVE_PX = 20;

/** CSS pixels from the upper left corner of the stage. */
export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** One body in the room: a dart that points along its x axis, its own axes, a plumb line to the floor, trail and name. */
export class BodyView {
  readonly group = new Group();
  readonly trail: Trail;
  readonly label = element('div', 'tagname');
  /** Present position of the drawing, between the last two frames. */
  readonly shown = new Vector3();
  private readonly marker = new Group();
  private readonly dartMaterial: MeshLambertMaterial;
  private readonly ellipsoid: Mesh;
  private readonly plumb: Line;
  private readonly ring: Mesh;
  private readonly colour: Color;
  private readonly fromP = new Vector3();
  private readonly fromQ = new Quaternion();
  private readonly toP = new Vector3();
  private readonly toQ = new Quaternion();
  private readonly stateText = element('span', 'substate');
  private placed = false;
  // Measured once per text: each query makes the browser lay out the page.
  private labelSize: { width: number; height: number } | null = null;
  private frame: BodyFrame | null = null;
  private sigmaScale = 0;
  private drawn = false;

  constructor(name: string, colour: string) {
    this.colour = new Color(colour);
    this.trail = new Trail(colour);
    this.dartMaterial = new MeshLambertMaterial({ color: this.colour, flatShading: true });
    this.marker.add(new Mesh(dart(), this.dartMaterial), bodyAxes());
    this.ellipsoid = new Mesh(
      new SphereGeometry(1, 28, 20),
      new MeshBasicMaterial({ color: this.colour, transparent: true, opacity: 0.22, depthWrite: false }),
    );
    this.ellipsoid.matrixAutoUpdate = false;
    const faint = new LineBasicMaterial({ color: this.colour, transparent: true, opacity: 0.45 });
    this.plumb = new Line(new BufferGeometry().setFromPoints([new Vector3(), new Vector3(0, 0, 1)]), faint);
    this.ring = new Mesh(
      new RingGeometry(0.8, 1, 40),
      new MeshBasicMaterial({ color: this.colour, transparent: true, opacity: 0.4, depthWrite: false }),
    );
    this.group.add(this.marker, this.ellipsoid, this.plumb, this.ring, this.trail.line);
    this.group.visible = false;
    this.label.style.setProperty('--body', colour);
    this.label.append(element('span', '', name), this.stateText);
    this.label.hidden = true;
  }

  set(frame: BodyFrame): void {
    this.frame = frame;
    this.trail.add(frame.valid && frame.pose ? frame.pose.p : null);
    this.group.visible = frame.pose !== null;
    if (!frame.pose) {
      this.placed = false;
      return;
    }
    // From where it is drawn; from its last goal when nothing was drawn since (a slow screen must not freeze).
    const [w, x, y, z] = frame.pose.q;
    if (!this.placed) {
      this.shown.set(...frame.pose.p);
      this.marker.quaternion.set(x, y, z, w);
    }
    const drawn = this.drawn || !this.placed;
    this.fromP.copy(drawn ? this.shown : this.toP);
    this.fromQ.copy(drawn ? this.marker.quaternion : this.toQ);
    this.toP.set(...frame.pose.p);
    this.toQ.set(x, y, z, w);
    this.placed = true;
    this.drawn = false;
    this.dress(frame);
  }

  setSigmaScale(scale: number): void {
    this.sigmaScale = scale;
    if (this.frame) this.dress(this.frame);
  }

  /** @param part  0 the frame before, 1 the newest frame */
  move(part: number, camera: Camera): void {
    if (!this.placed) return;
    this.drawn = true;
    this.shown.lerpVectors(this.fromP, this.toP, part);
    this.marker.position.copy(this.shown);
    this.marker.quaternion.slerpQuaternions(this.fromQ, this.toQ, part);
    const size = Math.max(SMALLEST_M, PART_OF_DISTANCE * camera.position.distanceTo(this.shown));
    this.marker.scale.setScalar(size);
    this.plumb.position.set(this.shown.x, this.shown.y, 0);
    this.plumb.scale.set(1, 1, this.shown.z);
    this.ring.position.set(this.shown.x, this.shown.y, 0.006);
    this.ring.scale.setScalar(size * 0.45);
    this.ellipsoid.matrix.setPosition(this.shown);
  }

  /** Preferred place of the name: above the marker. null: out of sight. @param width, height  of the stage */
  labelBox(camera: Camera, width: number, height: number): Box | null {
    const at = this.shown.clone().project(camera);
    this.label.hidden = !this.placed || at.z > 1 || Math.abs(at.x) > 1.05 || Math.abs(at.y) > 1.05;
    if (this.label.hidden) return null;
    if (!this.labelSize) this.labelSize = { width: this.label.offsetWidth, height: this.label.offsetHeight };
    const middle = ((at.x + 1) / 2) * width;
    const y = ((1 - at.y) / 2) * height - this.labelSize.height - ABOVE_PX;
    return { x: middle - this.labelSize.width / 2, y, ...this.labelSize };
  }

  placeLabel(box: Box): void {
    this.label.style.transform = `translate(${box.x.toFixed(1)}px, ${box.y.toFixed(1)}px)`;
  }

  dispose(): void {
    this.trail.dispose();
    this.label.remove();
    this.group.traverse((object) => {
      const drawn = object as Partial<Mesh>;
      drawn.geometry?.dispose();
    });
  }

  /** An invalid pose is grey and hollow. */
  private dress(frame: BodyFrame): void {
    this.dartMaterial.color.set(frame.valid ? this.colour : ROOM.invalid);
    this.dartMaterial.wireframe = !frame.valid;
    this.label.classList.toggle('invalid', !frame.valid);
    const note = frame.state === 'tracking' && frame.valid ? '' : noteOf(frame);
    if (this.stateText.textContent !== note) this.labelSize = null;
    setText(this.stateText, note);
    const cov = frame.valid ? frame.pose?.cov : null;
    this.ellipsoid.visible = Boolean(cov) && this.sigmaScale > 0;
    if (!cov || !frame.pose) return;
    this.ellipsoid.matrix.copy(ellipsoidMatrix(cov, frame.pose.p, this.sigmaScale));
  }
}

function noteOf(frame: BodyFrame): string {
  const word = STATE_WORD[frame.state].toLowerCase();
  return frame.valid ? word : `${word}, last known`;
}

/** A flat four-sided dart, one unit long, nose on +x, fin up +z. */
function dart(): BufferGeometry {
  const nose = [0.62, 0, 0];
  const left = [-0.38, 0.34, 0];
  const right = [-0.38, -0.34, 0];
  const keel = [-0.3, 0, -0.1];
  const fin = [-0.34, 0, 0.22];
  const tail = [-0.22, 0, 0.02];
  const faces = [
    [nose, left, fin], [nose, fin, right], [nose, keel, left], [nose, right, keel],
    [left, tail, fin], [fin, tail, right], [left, keel, tail], [keel, right, tail],
  ];
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(faces.flat(2), 3));
  geometry.computeVertexNormals();
  return geometry;
}

function bodyAxes(): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute([0, 0, 0, 1.1, 0, 0, 0, 0, 0, 0, 0.8, 0, 0, 0, 0, 0, 0, 0.8], 3));
  const colours = ['#ff8f86', '#7fe0a5', '#8cbcff'].flatMap((name) => {
    const { r, g, b } = new Color(name);
    return [r, g, b, r, g, b];
  });
  geometry.setAttribute('color', new Float32BufferAttribute(colours, 3));
  return new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true }));
}

