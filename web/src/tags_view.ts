import {
  BackSide,
  BufferGeometry,
  CanvasTexture,
  Color,
  Float32BufferAttribute,
  FrontSide,
  Group,
  InstancedMesh,
  LineBasicMaterial,
  LineLoop,
  LinearFilter,
  LinearMipmapLinearFilter,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  type PerspectiveCamera,
  Quaternion,
  Raycaster,
  SphereGeometry,
  SRGBColorSpace,
  type Vector2,
  Vector3,
} from 'three';
import { ellipsoid } from './covariance';
import type { MapTag } from './protocol';
import { disposeChildren, textSprite } from './text_sprite';
import { ROOM, TAG_COLOUR } from './theme';

// Above this many, ids would cover the room; they stay readable on the tags themselves.
const MOST_LABELS = 120;
const TEXTURE_SIDE = 2048;

/** The tags of the map: one mesh for all, each with its own square of one texture, in the colour of its state. */
export class TagsView {
  readonly group = new Group();
  private ellipsoids: InstancedMesh | null = null;
  private tags: MapTag[] = [];
  private faces: Mesh[] = [];
  private chosen: number | null = null;
  private frame: LineLoop | null = null;
  private readonly labels = new Group();
  private sigmaScale = 0;

  set(tags: MapTag[]): void {
    disposeChildren(this.labels);
    disposeChildren(this.group);
    this.ellipsoids = null;
    this.frame = null;
    this.faces = [];
    this.tags = tags;
    if (tags.length === 0) return;
    const perRow = Math.ceil(Math.sqrt(tags.length));
    const geometry = squares(tags, perRow);
    const front = new MeshBasicMaterial({ map: atlas(tags, perRow), side: FrontSide });
    const back = new MeshBasicMaterial({ vertexColors: true, side: BackSide });
    this.faces = [new Mesh(geometry, front), new Mesh(geometry, back)];
    this.group.add(...this.faces);
    this.group.add(this.labels);
    if (tags.length <= MOST_LABELS) this.addLabels();
    this.setSigmaScale(this.sigmaScale);
    this.choose(this.chosen);
  }

  /** @param point  of the picture, −1 … 1 both ways. @returns the tag that is seen there */
  at(point: Vector2, camera: PerspectiveCamera): number | null {
    const ray = new Raycaster();
    ray.setFromCamera(point, camera);
    const hit = ray.intersectObjects(this.faces, false)[0];
    return this.tags[Math.floor((hit?.faceIndex ?? NaN) / 2)]?.id ?? null;
  }

  /** Highlights this one; null: none. */
  choose(id: number | null): void {
    this.chosen = id;
    if (this.frame) {
      this.group.remove(this.frame);
      this.frame.geometry.dispose();
    }
    this.frame = null;
    const tag = this.tags.find((one) => one.id === id);
    if (!tag) return;
    const half = tag.edgeM * SHEET * 0.62;
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x = 0, y = 0]) => new Vector3(x * half, y * half, 0.01));
    this.frame = new LineLoop(
      new BufferGeometry().setFromPoints(corners),
      new LineBasicMaterial({ color: ROOM.chosen, depthTest: false }),
    );
    this.frame.quaternion.copy(rotation(tag));
    this.frame.position.set(...tag.p);
    this.group.add(this.frame);
  }

  /** On a small screen the ids are read on the tags themselves. */
  showLabels(visible: boolean): void {
    this.labels.visible = visible;
  }

  /** @param scale  0: none */
  setSigmaScale(scale: number): void {
    this.sigmaScale = scale;
    if (this.ellipsoids) {
      this.group.remove(this.ellipsoids);
      this.ellipsoids.geometry.dispose();
      this.ellipsoids.dispose();
      this.ellipsoids = null;
    }
    const known = this.tags.filter((tag) => tag.cov && (tag.sigmaMm ?? 0) > 0);
    if (scale === 0 || known.length === 0) return;
    const material = new MeshBasicMaterial({ transparent: true, opacity: 0.22, depthWrite: false });
    const mesh = new InstancedMesh(new SphereGeometry(1, 20, 14), material, known.length);
    known.forEach((tag, i) => {
      if (!tag.cov) return;
      mesh.setMatrixAt(i, ellipsoidMatrix(tag.cov, tag.p, scale));
      mesh.setColorAt(i, new Color(TAG_COLOUR[tag.state]));
    });
    this.ellipsoids = mesh;
    this.group.add(mesh);
  }

  private addLabels(): void {
    for (const tag of this.tags) {
      const label = textSprite(String(tag.id), { px: 12, colour: ROOM.tagLabel });
      // A little beyond the upper edge, so that it does not cover the tag.
      const above = new Vector3(0, tag.edgeM * 0.5 + 0.14, 0).applyQuaternion(rotation(tag)).add(new Vector3(...tag.p));
      label.position.copy(above);
      this.labels.add(label);
    }
  }
}

/** Unit sphere → 1-sigma ellipsoid × scale, at p. */
export function ellipsoidMatrix(cov: MapTag['cov'] & object, p: readonly number[], scale: number): Matrix4 {
  const { radii, axes } = ellipsoid(cov);
  const [a, b, c] = radii.map((radius) => Math.max(radius, 1e-5) * scale) as [number, number, number];
  const v = (row: number, column: number): number => axes[3 * row + column] ?? 0;
  // prettier-ignore
  return new Matrix4().set(
    v(0, 0) * a, v(0, 1) * b, v(0, 2) * c, p[0] ?? 0,
    v(1, 0) * a, v(1, 1) * b, v(1, 2) * c, p[1] ?? 0,
    v(2, 0) * a, v(2, 1) * b, v(2, 2) * c, p[2] ?? 0,
    0, 0, 0, 1);
}

function rotation(tag: MapTag): Quaternion {
  const [w, x, y, z] = tag.q;
  return new Quaternion(x, y, z, w);
}

// The edge is that of the black square; paper and state border lie outside of it.
const SHEET = 1.5;

function squares(tags: MapTag[], perRow: number): BufferGeometry {
  const positions: number[] = [];
  const uvs: number[] = [];
  const backs: number[] = [];
  const indices: number[] = [];
  tags.forEach((tag, i) => {
    const half = (tag.edgeM * SHEET) / 2;
    const turn = rotation(tag);
    // The back of a tag is dark paper with a tint of its state.
    const back = new Color(ROOM.line).lerp(new Color(TAG_COLOUR[tag.state]), 0.18);
    const corners: [number, number][] = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
    for (const [cx, cy] of corners) {
      // Slightly in front of the floor or wall it is on.
      const corner = new Vector3(cx * half, cy * half, 0.004).applyQuaternion(turn);
      positions.push(corner.x + tag.p[0], corner.y + tag.p[1], corner.z + tag.p[2]);
      backs.push(back.r, back.g, back.b);
      uvs.push(((i % perRow) + (cx + 1) / 2) / perRow, 1 - (Math.floor(i / perRow) + (1 - cy) / 2) / perRow);
    }
    const first = 4 * i;
    indices.push(first, first + 1, first + 2, first, first + 2, first + 3);
  });
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(positions, 3));
  geometry.setAttribute('uv', new Float32BufferAttribute(uvs, 2));
  geometry.setAttribute('color', new Float32BufferAttribute(backs, 3));
  geometry.setIndex(indices);
  return geometry;
}

/** Every tag's face in one picture: state border, paper, black square, id in the middle. */
function atlas(tags: MapTag[], perRow: number): CanvasTexture {
  const cell = Math.max(16, Math.min(160, Math.floor(TEXTURE_SIDE / perRow)));
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = cell * perRow;
  const context = canvas.getContext('2d');
  if (!context) throw new Error('no 2D canvas');
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  tags.forEach((tag, i) => {
    const x = (i % perRow) * cell;
    const y = Math.floor(i / perRow) * cell;
    drawTag(context, tag, x, y, cell);
  });
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.magFilter = LinearFilter;
  texture.anisotropy = 8;
  return texture;
}

function drawTag(context: CanvasRenderingContext2D, tag: MapTag, x: number, y: number, cell: number): void {
  const square = (from: number, colour: string): void => {
    context.fillStyle = colour;
    context.fillRect(x + from * cell, y + from * cell, cell * (1 - 2 * from), cell * (1 - 2 * from));
  };
  square(0, TAG_COLOUR[tag.state]);
  square(0.07, '#f4f7f9');
  square((1 - 1 / SHEET) / 2, '#0c1116');
  context.fillStyle = '#f4f7f9';
  const text = String(tag.id);
  context.font = `700 ${Math.round(cell * (text.length > 2 ? 0.24 : 0.36))}px system-ui, sans-serif`;
  context.fillText(text, x + cell / 2, y + cell * 0.52);
}
