import { ArrowHelper, Group, Mesh, MeshBasicMaterial, SphereGeometry, Vector3 } from 'three';
import type { TagChange, Vector3 as Place } from './protocol';
import { disposeChildren } from './text_sprite';
import { ROOM, TAG_COLOUR } from './theme';

// Least length of the longest arrow, to be found in a hall …
const VISIBLE_M = 0.4;
// … and of the shortest.
const SHORTEST_M = 0.1;
const MOST = 1000;

/** Magnification of the arrows: 1, 10, 100 or 1000, so that the longest one is visible. */
export function exaggeration(changes: TagChange[]): number {
  const longest = Math.max(0, ...changes.map((change) => (change.kind === 'moved' ? change.mm / 1e3 : 0)));
  let factor = 1;
  while (longest > 0 && longest * factor < VISIBLE_M && factor < MOST) factor *= 10;
  return factor;
}

/** Differences to another version of the map: an arrow for each tag that moved, a mark for each that is new or gone. */
export class ChangesView {
  readonly group = new Group();

  set(changes: TagChange[]): void {
    disposeChildren(this.group);
    const factor = exaggeration(changes);
    for (const { kind, from, to } of changes) {
      if (kind === 'moved' && from && to) this.group.add(arrow(from, to, factor));
      if (kind === 'added' && to) this.group.add(mark(to, TAG_COLOUR.calibrated));
      if (kind === 'removed' && from) this.group.add(mark(from, TAG_COLOUR.quarantined));
    }
  }
}

function arrow(from: Place, to: Place, factor: number): ArrowHelper {
  const start = new Vector3(...from);
  const way = new Vector3(...to).sub(start);
  const length = Math.max(way.length() * factor, SHORTEST_M);
  const direction = way.lengthSq() > 0 ? way.normalize() : new Vector3(0, 0, 1);
  return new ArrowHelper(direction, start, length, ROOM.change, 0.35 * length, 0.2 * length);
}

function mark(place: Place, colour: string): Mesh {
  // A ball of this resolution is an octahedron, which bodies use already.
  const made = new Mesh(new SphereGeometry(0.22, 4, 2), new MeshBasicMaterial({ color: colour, wireframe: true }));
  made.position.set(...place);
  return made;
}
