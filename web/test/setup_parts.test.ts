import { describe, expect, it } from 'vitest';
import { isMapped, movingWords, servedBy } from '../src/setup/guide_words';
import { keptWords } from '../src/setup/memory';
import { afterVerdict, judge } from '../src/setup/parts';
import { pictureWords } from '../src/setup/overlay';
import type { Lens, Picture, SetupState } from '../src/setup/protocol';

const verdict = { good: true, refused: false, summary: '', advice: [] };
const after = (change: Partial<SetupState>): ReturnType<typeof afterVerdict> =>
  afterVerdict({ solving: false, verdict: null, ...change } as SetupState);

describe('a step that ends with a verdict', () => {
  it('goes on at once when it is good', () => {
    expect(after({ verdict })).toMatchObject({ words: 'Next', ready: true, blocked: '' });
  });

  it('asks to take what is not good, and never what is refused', () => {
    expect(after({ verdict: { ...verdict, good: false } }).words).toBe('Accept and continue');
    const refused = after({ verdict: { ...verdict, good: false, refused: true } });
    expect(refused.commands()).toEqual([{ name: 'again' }]);
  });

  it('waits while it is worked out', () => {
    expect(after({ solving: true }).blocked).not.toBe('');
    expect(after({})).toMatchObject({ ready: false, blocked: '' });
  });

  it('is judged in words, too', () => {
    expect(judge(verdict)).toEqual({ tone: 'good', words: 'Good' });
    expect(judge({ ...verdict, good: false }).words).toBe('Usable, but not good');
    expect(judge({ ...verdict, refused: true }).words).toBe('Not usable');
  });
});

describe('the picture', () => {
  const picture = { outlines: [{ id: 7 }, { id: 3 }] } as unknown as Picture;

  it('is told to who does not see it', () => {
    expect(pictureWords({ picture: null, lens: null })).toBe('No picture yet.');
    expect(pictureWords({ picture, lens: null })).toBe('Live picture. Tags seen: 3, 7.');
    const lens = { covered: 0.43 } as Lens;
    expect(pictureWords({ picture: { ...picture, outlines: [] }, lens })).toBe(
      'Live picture. No tag is seen. 43 % of the image is covered.',
    );
  });
});

describe('the second half', () => {
  it('tells how the map grows', () => {
    const bodies = [{ id: 1, state: 'tracking' as const }];
    expect(movingWords(12, 2, bodies, () => 'robot')).toBe('12 tags in the map · robot: tracking');
    expect(movingWords(1, 14.7, [], () => '')).toBe('1 tag in the map, no new one for 14 s');
    expect(movingWords(0, 14, [], () => '')).toBe('0 tags in the map');
    expect(isMapped(12, 12, bodies)).toBe(true);
    expect(isMapped(12, 2, bodies)).toBe(false);
    expect(isMapped(0, 12, bodies)).toBe(false);
    expect(isMapped(12, 12, [{ state: 'lost' }])).toBe(false);
  });

  it('finds where clients connect in the server’s log', () => {
    const lines = [
      { module: 'vrpn', text: 'serves VRPN 07.35 on 0.0.0.0:3883' },
      { module: 'vrpn', text: 'client 10.0.0.7 connected' },
      { module: 'web', text: 'page at http://127.0.0.1:8080/' },
      { module: 'vrpn', text: 'serves VRPN 07.35 on 0.0.0.0:3884' },
    ];
    expect(servedBy(lines, '10.0.0.2')).toEqual([
      { protocol: 'vrpn', words: 'VRPN 07.35 on 10.0.0.2:3884' },
      { protocol: 'web', words: 'http://127.0.0.1:8080/' },
    ]);
  });
});

describe('what was typed before the page was loaded again', () => {
  it('is a list of words, or nothing', () => {
    expect(keptWords('["forward","0.1"]')).toEqual(['forward', '0.1']);
    for (const broken of [null, '', '{', '{"a":1}', '7']) expect(keptWords(broken)).toEqual([]);
  });
});
