import {
  BufferGeometry,
  Color,
  Float32BufferAttribute,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  PlaneGeometry,
} from 'three';
import { ROOM } from './theme';
import { disposeChildren, textSprite } from './text_sprite';

/** The floor rectangle in whole metres. */
export interface Extent {
  x0: number;
  x1: number;
  y0: number;
  y1: number;
  /** Height of the highest object. */
  top: number;
}

export const EMPTY_ROOM: Extent = { x0: -3, x1: 3, y0: -3, y1: 3, top: 2 };

/** The floor rectangle that holds `points`, and the origin, in whole metres. */
export function extentOf(points: readonly (readonly [number, number, number])[]): Extent {
  if (points.length === 0) return EMPTY_ROOM;
  const xs = points.map((p) => p[0]);
  const ys = points.map((p) => p[1]);
  return {
    x0: Math.floor(Math.min(...xs, 0)),
    x1: Math.ceil(Math.max(...xs, 0)),
    y0: Math.floor(Math.min(...ys, 0)),
    y1: Math.ceil(Math.max(...ys, 0)),
    top: Math.max(1, ...points.map((p) => p[2])),
  };
}

export function sameExtent(a: Extent, b: Extent): boolean {
  return a.x0 === b.x0 && a.x1 === b.x1 && a.y0 === b.y0 && a.y1 === b.y1 && a.top === b.top;
}

/** Floor, metre grid with its marks, and the axes of the workspace. */
export class RoomView {
  readonly group = new Group();

  /** @param narrow  a small screen: fewer marks */
  set(extent: Extent, narrow: boolean): void {
    disposeChildren(this.group);
    this.group.add(floor(extent), grid(extent), axes());
    this.addMarks(extent, narrow);
  }

  private addMarks(extent: Extent, narrow: boolean): void {
    const { x0, x1, y0, y1 } = extent;
    const step = Math.max(x1 - x0, y1 - y0) > 14 ? 5 : narrow ? 2 : 1;
    const look = { px: narrow ? 11 : 13, colour: ROOM.mark };
    const mark = (text: string, x: number, y: number): void => {
      const sprite = textSprite(text, look);
      sprite.position.set(x, y, 0);
      this.group.add(sprite);
    };
    // The last mark of each edge names the axis and the unit.
    const word = (axis: string, at: number, last: boolean): string => {
      const metres = String(at).replace('-', '−');
      return last ? `${axis} ${metres} m` : metres;
    };
    for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) mark(word('x', x, x + step > x1), x, y0 - 0.35);
    for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) mark(word('y', y, y + step > y1), x1 + 0.4, y);
    const names: [string, string, number, number, number][] = [
      ['x', '#ff8f86', 0.78, 0, 0.04],
      ['y', '#7fe0a5', 0, 0.78, 0.04],
      ['z', '#8cbcff', 0, 0, 0.8],
    ];
    for (const [name, colour, x, y, z] of names) {
      const sprite = textSprite(name, { px: narrow ? 12 : 15, colour, bold: true });
      sprite.position.set(x, y, z);
      this.group.add(sprite);
    }
  }
}

function floor({ x0, x1, y0, y1 }: Extent): Mesh {
  const plane = new Mesh(new PlaneGeometry(x1 - x0, y1 - y0), new MeshBasicMaterial({ color: ROOM.floor }));
  plane.position.set((x0 + x1) / 2, (y0 + y1) / 2, -0.01);
  return plane;
}

function grid({ x0, x1, y0, y1 }: Extent): LineSegments {
  const points: number[] = [];
  const colours: number[] = [];
  const line = (ax: number, ay: number, bx: number, by: number, strong: boolean): void => {
    const { r, g, b } = new Color(strong ? ROOM.lineStrong : ROOM.line);
    points.push(ax, ay, 0, bx, by, 0);
    colours.push(r, g, b, r, g, b);
  };
  for (let x = x0; x <= x1; ++x) line(x, y0, x, y1, x % 5 === 0 || x === x0 || x === x1);
  for (let y = y0; y <= y1; ++y) line(x0, y, x1, y, y % 5 === 0 || y === y0 || y === y1);
  return lines(points, colours);
}

function axes(): LineSegments {
  const long = 0.65;
  const points = [0, 0, 0.004, long, 0, 0.004, 0, 0, 0.004, 0, long, 0.004, 0, 0, 0, 0, 0, long];
  const colours = ['#ff8f86', '#7fe0a5', '#8cbcff'].flatMap((name) => {
    const { r, g, b } = new Color(name);
    return [r, g, b, r, g, b];
  });
  return lines(points, colours);
}

function lines(points: number[], colours: number[]): LineSegments {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(points, 3));
  geometry.setAttribute('color', new Float32BufferAttribute(colours, 3));
  return new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true }));
}
