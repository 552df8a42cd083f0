import { describe, expect, it } from 'vitest';
import type { BodyFrame, BodyState } from '../src/protocol';
import { SteadyStates } from '../src/steady';

/** States at 0, 0.25, 0.5 … s, as they are shown. */
function shown(states: BodyState[]): string[] {
  const steady = new SteadyStates();
  return states.map((state, i) => {
    const body = { id: 1, state, pose: null } as BodyFrame;
    return steady.take([body], 1e12 + 250 * i)[0]?.state ?? '';
  });
}

describe('SteadyStates', () => {
  it('shows a worse state at once, a better one after a second', () => {
    const [bad, good] = ['lost', 'tracking'] as const;
    expect(shown([good, bad, good, good, good, good, good, bad])).toEqual(
      [good, bad, bad, bad, bad, bad, good, bad],
    );
  });

  it('does not flicker between coasting and tracking', () => {
    const states = Array.from({ length: 40 }, (_, i) => (i % 3 === 1 ? 'coasting' : 'tracking') as BodyState);
    expect(new Set(shown(states).slice(1))).toEqual(new Set(['coasting']));
  });

  it('counts the age of what is shown, and knows none from before', () => {
    const steady = new SteadyStates();
    const age = (state: BodyState, ms: number, pose: BodyFrame['pose'] = null): number | null =>
      steady.take([{ id: 1, state, pose } as BodyFrame], 1e12 + ms)[0]?.stateAgeMs ?? null;
    expect(age('tracking', 0)).toBeNull();
    expect(age('tracking', 5000)).toBeNull();
    expect(age('coasting', 6000)).toBe(0);
    expect(age('coasting', 6700)).toBe(700);
    expect(age('tracking', 7000)).toBe(1000);
    expect(age('tracking', 8500)).toBe(1500);
  });

  it('takes the age of the last tag for a body that was lost before', () => {
    const body = { id: 1, state: 'lost', pose: { ageMs: 42_000 } } as BodyFrame;
    expect(new SteadyStates().take([body], 1e12)[0]?.stateAgeMs).toBe(42_000);
  });
});
