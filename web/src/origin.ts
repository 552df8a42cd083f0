// The new origin of the room, in the present axes.
import type { MeasuredPlace } from './control_codec';
import type { MapTag, Vector3 } from './protocol';

/** The vertical is known by gravity: place and heading are to be chosen. */
export interface Origin {
  x: number;
  y: number;
  z: number;
  /** Of the x axis, degrees, counter-clockwise from above. */
  turn: number;
}

export const UNCHANGED: Origin = { x: 0, y: 0, z: 0, turn: 0 };

const DEGREE = Math.PI / 180;
const LEAST_TAGS = 3;
const MOST_TAGS = 12;

/** A present place in the new axes. */
export function seenFrom(origin: Origin, [x, y, z]: Vector3): Vector3 {
  const c = Math.cos(origin.turn * DEGREE);
  const s = Math.sin(origin.turn * DEGREE);
  const [dx, dy] = [x - origin.x, y - origin.y];
  return [c * dx + s * dy, -s * dx + c * dy, z - origin.z];
}

/** The heading from the origin to a place; null: it is above or below it. */
export function turnTowards(origin: Origin, [x, y]: readonly [number, number, ...number[]]): number | null {
  const [dx, dy] = [x - origin.x, y - origin.y];
  return Math.hypot(dx, dy) < 1e-3 ? null : Math.atan2(dy, dx) / DEGREE;
}

/** Tags that can define the room. */
export function usableTags(tags: readonly MapTag[]): MapTag[] {
  return tags.filter((tag) => tag.state !== 'quarantined' && tag.component === 0);
}

/** Sent to the server: places of tags in the new axes. Throws a message. */
export function placesFor(origin: Origin, tags: readonly MapTag[]): MeasuredPlace[] {
  const usable = usableTags(tags);
  if (usable.length < LEAST_TAGS)
    throw new Error(
      `The map has ${usable.length} of the ${LEAST_TAGS} tags that are needed: let it see more, or set map.reference_pose in the configuration`,
    );
  const middle = [0, 1].map((axis) => usable.reduce((sum, tag) => sum + (tag.p[axis] ?? 0), 0) / usable.length);
  const away = ({ p }: MapTag): number => Math.hypot(p[0] - (middle[0] ?? 0), p[1] - (middle[1] ?? 0));
  // The outer ones determine the heading best.
  const chosen = [...usable].sort((a, b) => away(b) - away(a)).slice(0, MOST_TAGS);
  return chosen.map((tag) => ({ tag: tag.id, p: seenFrom(origin, tag.p) }));
}

/** Meaning of the three clicks, in their order. */
export const PICKS = ['origin', 'heading', 'floor'] as const;
export type Pick = (typeof PICKS)[number];

export const PICK_WORDS: Record<Pick, string> = {
  origin: 'the tag below or above which the origin shall be',
  heading: 'the tag that the x axis shall point to',
  floor: 'a tag at the height that shall be zero',
};

/** The origin once a tag was picked. */
export function picked(origin: Origin, pick: Pick, tag: MapTag): Origin {
  if (pick === 'origin') return { ...origin, x: tag.p[0], y: tag.p[1] };
  if (pick === 'floor') return { ...origin, z: tag.p[2] };
  return { ...origin, turn: turnTowards(origin, tag.p) ?? origin.turn };
}
