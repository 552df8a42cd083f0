import { ArrowHelper, Group, Vector3 } from 'three';
import type { TagChange, Vector3 as Place } from './protocol';
import { ROOM } from './theme';

// A tag that moved by millimetres is still to be found in a hall.
const SHORTEST_M = 0.3;

/** Where tags were in another version of the map: an arrow for each that moved, as long as it moved, or visible. */
export class ChangesView {
  readonly group = new Group();

  set(changes: TagChange[]): void {
    for (const child of [...this.group.children]) {
      this.group.remove(child);
      if (child instanceof ArrowHelper) child.dispose();
    }
    for (const { from, to } of changes) if (from && to) this.group.add(arrow(from, to));
  }
}

function arrow(from: Place, to: Place): ArrowHelper {
  const start = new Vector3(...from);
  const way = new Vector3(...to).sub(start);
  const length = Math.max(way.length(), SHORTEST_M);
  const direction = way.lengthSq() > 0 ? way.normalize() : new Vector3(0, 0, 1);
  return new ArrowHelper(direction, start, length, ROOM.tagLabel, 0.35 * length, 0.2 * length);
}
