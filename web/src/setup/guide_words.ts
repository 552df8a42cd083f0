// Texts of the second half of the set-up: the robot moves, the map grows.
import { plural } from '../format';
import type { BodyFrame, LogLine } from '../protocol';
import { STATE_WORD } from '../theme';

export const GUIDE_STEPS = ['move', 'freeze', 'align', 'done'] as const;
export type GuideStep = (typeof GUIDE_STEPS)[number];

export const GUIDE_WORDS: Record<GuideStep, { title: string; todo: string; primary: string }> = {
  move: {
    title: 'Move the robot past all tags',
    todo: 'Slowly, so that two tags or more are in view when a new one comes in.',
    primary: 'All tags are in the map',
  },
  freeze: {
    title: 'Freeze the map',
    todo: 'From then on no tag moves and none joins, until you let it grow again.',
    primary: 'Freeze the map',
  },
  align: {
    title: 'Set the origin',
    todo:
      'The vertical is known by gravity. The origin is at the first tag, until you drag it, set ' +
      'it by three tags or enter measured places: streamed poses follow.',
    primary: 'Choose the origin…',
  },
  done: {
    title: 'Done: poses are streamed',
    todo: 'Clients find them here:',
    primary: 'Close',
  },
};

const QUIET_S = 10; // without a new tag: the map may be complete

/** `12 tags in the map, no new one for 14 s · robot: tracking` @param quietS  since one joined */
export function movingWords(
  tags: number,
  quietS: number,
  bodies: readonly Pick<BodyFrame, 'id' | 'state'>[],
  nameOf: (id: number) => string,
): string {
  const quiet = tags > 0 && quietS >= QUIET_S ? `, no new one for ${Math.floor(quietS)} s` : '';
  const robots = bodies.map(({ id, state }) => `${nameOf(id)}: ${STATE_WORD[state].toLowerCase()}`);
  return [`${plural(tags, 'tag', 'tags')} in the map${quiet}`, ...robots].join(' · ');
}

/** Before it the map is not worth freezing. */
export function isMapped(
  tags: number,
  quietS: number,
  bodies: readonly Pick<BodyFrame, 'state'>[],
): boolean {
  return tags > 0 && quietS >= QUIET_S && bodies.some(({ state }) => state === 'tracking');
}

export interface Served {
  protocol: string;
  words: string;
}

/**
 * Addresses for clients, from the server's log at its start. The newest line counts.
 * @param host  of this page: replaces "every address of the server", to which no client can connect
 */
export function servedBy(
  lines: readonly Pick<LogLine, 'module' | 'text'>[],
  host: string,
): Served[] {
  const found = new Map<string, string>();
  for (const { module, text } of lines) {
    const match = /^(?:serves |page at )(.+)$/.exec(text);
    if (match?.[1]) found.set(module, match[1].replace('0.0.0.0', host));
  }
  return [...found]
    .map(([protocol, words]) => ({ protocol, words }))
    .sort((a, b) => a.protocol.localeCompare(b.protocol));
}
