import { plural } from './format';
import type { TagMap } from './protocol';

/** `Version 12 · 24 tags · tag36h11 · reference 0 · mapping` */
export function mapLine(map: TagMap, mode: string): string {
  const parts = [
    map.version > 0 ? `Version ${map.version}` : 'Not stored',
    plural(map.tags.length, 'tag', 'tags'),
    map.family,
  ];
  if (map.referenceTag !== null) parts.push(`reference ${map.referenceTag}`);
  if (mode) parts.push(mode);
  return parts.join(' · ');
}
