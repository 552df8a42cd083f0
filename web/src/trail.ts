import { Color, InstancedInterleavedBuffer, InterleavedBufferAttribute, Vector2 } from 'three';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';
import type { Vector3 as Triple } from './protocol';
import { ROOM } from './theme';

const LENGTH = 300; // points: 15 s at 20 Hz
const LONGEST_STEP_M = 1; // a jump (map correction, body found again) is not a path

/** The last seconds of one body as a line that fades into the floor. Its buffers are made once. */
export class Trail {
  readonly line: LineSegments2;
  private readonly points: (Triple | null)[] = [];
  private readonly positions = new Float32Array(6 * LENGTH);
  private readonly colours = new Float32Array(6 * LENGTH);
  private readonly positionBuffer = new InstancedInterleavedBuffer(this.positions, 6, 1);
  private readonly colourBuffer = new InstancedInterleavedBuffer(this.colours, 6, 1);
  private readonly material: LineMaterial;
  private readonly fade: Color[];

  constructor(colour: string) {
    const from = new Color(ROOM.floor);
    const to = new Color(colour);
    this.fade = Array.from({ length: LENGTH }, (_, i) => from.clone().lerp(to, (0.85 * i) / LENGTH));
    const geometry = new LineSegmentsGeometry();
    geometry.setAttribute('instanceStart', new InterleavedBufferAttribute(this.positionBuffer, 3, 0));
    geometry.setAttribute('instanceEnd', new InterleavedBufferAttribute(this.positionBuffer, 3, 3));
    geometry.setAttribute('instanceColorStart', new InterleavedBufferAttribute(this.colourBuffer, 3, 0));
    geometry.setAttribute('instanceColorEnd', new InterleavedBufferAttribute(this.colourBuffer, 3, 3));
    geometry.instanceCount = 0;
    this.material = new LineMaterial({ linewidth: 2.5, vertexColors: true });
    this.line = new LineSegments2(geometry, this.material);
    this.line.frustumCulled = false;
  }

  /** @param point  null: the path is interrupted here */
  add(point: Triple | null): void {
    this.points.push(point);
    if (this.points.length > LENGTH) this.points.shift();
    this.write();
  }

  resize(width: number, height: number): void {
    this.material.resolution = new Vector2(width, height);
  }

  dispose(): void {
    this.line.geometry.dispose();
    this.material.dispose();
  }

  private write(): void {
    let segments = 0;
    const offset = LENGTH - this.points.length;
    for (let i = 1; i < this.points.length; ++i) {
      const a = this.points[i - 1];
      const b = this.points[i];
      if (!a || !b || Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]) > LONGEST_STEP_M) continue;
      this.positions.set(a, 6 * segments);
      this.positions.set(b, 6 * segments + 3);
      this.fade[offset + i - 1]?.toArray(this.colours, 6 * segments);
      this.fade[offset + i]?.toArray(this.colours, 6 * segments + 3);
      segments += 1;
    }
    this.positionBuffer.needsUpdate = true;
    this.colourBuffer.needsUpdate = true;
    (this.line.geometry as LineSegmentsGeometry).instanceCount = segments;
  }
}
