import { plural } from './format';
import type { TagMap, TagState } from './protocol';

const ORDER: TagState[] = ['surveyed', 'calibrated', 'local', 'quarantined'];

/** `Version 12 · 24 tags: 4 surveyed, 14 calibrated, 6 local · tag36h11 · reference 0 · mapping` */
export function mapLine(map: TagMap, mode: string): string {
  const perState = ORDER.flatMap((state) => {
    const number = map.tags.filter((tag) => tag.state === state).length;
    return number > 0 ? [`${number} ${state}`] : [];
  });
  const tags = plural(map.tags.length, 'tag', 'tags');
  const parts = [
    map.version > 0 ? `Version ${map.version}` : 'Not stored yet',
    perState.length > 0 ? `${tags}: ${perState.join(', ')}` : tags,
    map.family,
  ];
  if (map.referenceTag !== null) parts.push(`reference ${map.referenceTag}`);
  if (mode) parts.push(mode);
  return parts.join(' · ');
}
