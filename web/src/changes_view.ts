import { ArrowHelper, Group, Mesh, MeshBasicMaterial, SphereGeometry, Vector3 } from 'three';
import type { TagChange, Vector3 as Place } from './protocol';
import { disposeChildren } from './text_sprite';
import { ROOM, TAG_COLOUR } from './theme';

// So long the longest arrow should be, to be found in a hall …
const VISIBLE_M = 0.4;
// … and the shortest, which does not grow any more.
const SHORTEST_M = 0.1;
const MOST = 1000;

/** By how much arrows are drawn longer than tags moved: 1, 10, 100 or 1000, so that the longest one is seen. */
export function exaggeration(changes: TagChange[]): number {
  const longest = Math.max(0, ...changes.map((change) => (change.kind === 'moved' ? change.mm / 1e3 : 0)));
  let factor = 1;
  while (longest > 0 && longest * factor < VISIBLE_M && factor < MOST) factor *= 10;
  return factor;
}

/** How another version of the map differs: an arrow for each tag that moved, a mark for each that is new or gone. */
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
  // So coarse a ball is an octahedron, and bodies use it anyway.
  const made = new Mesh(new SphereGeometry(0.22, 4, 2), new MeshBasicMaterial({ color: colour, wireframe: true }));
  made.position.set(...place);
  return made;
}
