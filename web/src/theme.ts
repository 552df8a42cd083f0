// Colours that both the style sheet's world and WebGL need. Identity colours keep clear of the state colours.
import type { BodyState, TagState } from './protocol';

const IDENTITY = ['#7cc4ff', '#c8a2ff', '#ffb28a', '#7fe0d0', '#f3a6c8', '#e6dc8a', '#a9b8ff', '#c9e68f', '#6f9bd8', '#d7b8e8', '#e0c4a8', '#9fc9c0'];

/** The colour of a body in cards, room and chart. @param place its place in the server's list */
export function bodyColour(place: number): string {
  return IDENTITY[place % IDENTITY.length] ?? '#7cc4ff';
}

export const STATE_WORD: Record<BodyState, string> = {
  searching: 'Searching',
  tracking: 'Tracking',
  coasting: 'Coasting',
  lost: 'Lost',
};

export const TAG_COLOUR: Record<TagState, string> = {
  surveyed: '#e8eef3',
  calibrated: '#4fd08b',
  local: '#f0b44c',
  quarantined: '#ff7a70',
};

export const ROOM = {
  background: '#0d1318',
  floor: '#121a21',
  line: '#22303b',
  lineStrong: '#34485a',
  mark: '#8da1b3',
  tagLabel: '#b9c6d2',
  chosen: '#8cc8ff',
  change: '#ffd27a',
  invalid: '#75838f',
};
