import { describe, expect, it } from 'vitest';
import { imuSource, imuType, yamlText } from '../src/setup/imu_source';
import { commandPath } from '../src/setup/link';
import { parseSetup, type SetupState } from '../src/setup/protocol';
import {
  doneWords, listSteps, pictureFacts, printCommand, progressWords, tokenFile, typedNumber,
} from '../src/setup/words';

const NAMES = ['camera', 'picture', 'sheet', 'lens', 'imu', 'rest', 'mount', 'wave', 'finish'];
const OUTLINE = { id: 3, margin: 61.2, corners: [[1, 2], [3, 2], [3, 4], [1, 4]] };
const STATE = {
  step: 'lens',
  steps: NAMES.map((name) => ({ name, left_out: name === 'rest' || name === 'wave' })),
  file: '/home/lab/robot.yaml',
  exists: false,
  missing: '',
  error: '',
  solving: false,
  cameras: [{ open: '/dev/video0', name: 'HD Webcam (uvcvideo)', problem: '' }],
  camera: { open: '/dev/video0', exposure_ms: 5 },
  picture: {
    width: 752, height: 480, rate_hz: 19.9, histogram: [1, 2], bright_share: 0.01, dark_share: 0.1,
    focus_px: 2.1, motion_px: null, verdict: 'Well exposed and sharp.', good: true,
    outlines: [OUTLINE],
  },
  sheet: { family: 'tag36h11', size_mm: 160, families: ['tag36h11', 'DICT_4X4_50'] },
  lens: {
    columns: 2, rows: 2, points: [0, 1, 2, 3], covered: 0.5, views: 12, tilted: 5,
    hint: 'Move it to the lower right of the image.', enough: false,
  },
  imu: { used: true, simulated: false, rate_hz: 200.4, types: ['line'], parts: ['bmi088'] },
  rest: null,
  wave: null,
  verdict: { good: true, refused: false, summary: '31 views, 0.21 px', advice: ['Go on.'] },
  written: false,
};
const parsed = (change: object = {}): SetupState =>
  parseSetup(JSON.stringify({ ...STATE, ...change }));

describe('parseSetup', () => {
  it('reads what the server says', () => {
    const state = parsed();
    expect(state.step).toBe('lens');
    expect(state.steps[5]).toEqual({ name: 'rest', leftOut: true, skipped: false });
    expect(state.camera).toEqual({ open: '/dev/video0', exposureMs: 5 });
    expect(state.picture?.motionPx).toBeNull();
    expect(state.picture?.outlines[0]?.corners[2]).toEqual([3, 4]);
    expect(state.lens?.points).toEqual([0, 1, 2, 3]);
    expect(state.verdict?.advice).toEqual(['Go on.']);
    expect(state.configuration).toBe('');
  });

  it('reads a beginning, when there is hardly anything', () => {
    const none = { camera: null, picture: null, lens: null, imu: null, verdict: null, cameras: [] };
    const state = parsed({ step: 'camera', ...none });
    expect(state.camera).toBeNull();
    expect(state.lens).toBeNull();
  });

  it('takes nothing that is malformed, and says what', () => {
    expect(() => parsed({ step: 'paint' })).toThrow(/step: paint is none of camera/);
    expect(() => parsed({ lens: { ...STATE.lens, points: [1, 2, 3] } })).toThrow(/3 for 2 × 2/);
    const flat = { ...STATE.picture, width: 0 };
    expect(() => parsed({ picture: flat })).toThrow(/no size of an image/);
    const half = { ...OUTLINE, corners: [[1, 2], [3, 2], [3, 4]] };
    expect(() => parsed({ picture: { ...STATE.picture, outlines: [half] } })).toThrow(/four/);
    const wave = { turned: [1, 0.3], shaken: 0, seen: 0, hint: '' };
    expect(() => parsed({ wave })).toThrow(/three numbers/);
    for (const json of ['', '[]', 'null', '{"step":"lens"}'])
      expect(() => parseSetup(json)).toThrow();
  });
});

describe('the list of steps', () => {
  it('marks what is done, and leaves out what is not taken', () => {
    const marks = listSteps(parsed()).map(({ mark }) => mark);
    const [done, out] = ['done', 'left out'];
    expect(marks).toEqual([done, done, done, 'current', 'open', out, 'open', out, 'open']);
    expect(progressWords(parsed())).toBe('Step 4 of 7');
  });

  it('calls a skipped step skipped, not done', () => {
    const steps = NAMES.map((name) => ({ name, left_out: false, skipped: name === 'lens' }));
    const marks = listSteps(parsed({ step: 'rest', steps })).map(({ mark }) => mark);
    expect(marks.slice(2, 6)).toEqual(['done', 'skipped', 'done', 'current']);
    expect(listSteps(parsed({ step: 'lens', steps }))[3]?.mark).toBe('current');
  });

  it('says what each step came to', () => {
    expect(doneWords(parsed(), 'camera', '')).toBe('HD Webcam (uvcvideo)');
    expect(doneWords(parsed(), 'sheet', '')).toBe('tag36h11, 160 mm');
    expect(doneWords(parsed(), 'imu', '')).toBe('200 samples a second');
    expect(doneWords(parsed({ imu: { ...STATE.imu, used: false } }), 'imu', '')).toBe('None');
    expect(doneWords(parsed(), 'lens', '31 views')).toBe('31 views');
  });
});

describe('words', () => {
  it('of the picture', () => {
    expect(pictureFacts(parsed())).toBe('752 × 480 · 19.9 images/s · 1 tag seen');
    expect(pictureFacts(parsed({ picture: null }))).toMatch(/^Waiting/);
    expect(pictureFacts(parsed({ picture: null, camera: null }))).toMatch(/^No camera/);
  });

  it('name the token’s file beside the configuration', () => {
    expect(tokenFile('/home/lab.2/robot.yaml')).toBe('/home/lab.2/robot.token');
    expect(tokenFile('robot')).toBe('robot.token');
  });

  it('print sheets of the family and the size', () => {
    expect(printCommand('tag36h11', '160', 'a4')).toBe(
      'fiducap tags sheet --ids 0-11 --size-mm 160 --out tags.pdf',
    );
    expect(printCommand('tag16h5', '62.5', 'a3')).toMatch(
      /--size-mm 62\.5 --family tag16h5 --paper a3 --out/,
    );
  });

  it('take numbers as people type them', () => {
    expect(typedNumber(' 62,5 ')).toBe(62.5);
    expect(typedNumber('-0.05')).toBe(-0.05);
    for (const bad of ['', ' ', '12 mm', 'NaN', 'Infinity']) expect(typedNumber(bad)).toBeNull();
  });
});

describe('imuSource', () => {
  it('writes the section of each type', () => {
    const line = { device: '/dev/ttyACM0', baud: '115200' };
    expect(imuSource('line', line, '')).toBe('type: line\ndevice: /dev/ttyACM0\nbaud: 115200');
    expect(imuSource('mavlink', { port: '14550' }, 'frd')).toBe('type: mavlink\nport: 14550');
    expect(imuSource('iio', {}, 'camera')).toBe('type: iio\naxes: camera');
    expect(imuSource('px4', {}, 'flu')).toBe('type: px4');
    expect(imuSource('ros', { topic: '/imu/data' }, '')).toBe('type: ros\ntopic: /imu/data');
  });

  it('lets nobody write another section by a name', () => {
    expect(imuSource('line', { device: 'a: b\nc: d', baud: '1' }, '')).toBe(
      'type: line\ndevice: "a: b\\nc: d"\nbaud: 1',
    );
    expect(yamlText('12')).toBe('"12"');
    expect(yamlText('#x')).toBe('"#x"');
  });

  it('says what is missing or no number', () => {
    expect(() => imuSource('line', { device: '', baud: '1' }, '')).toThrow('Device: write one.');
    expect(() => imuSource('mavlink', { port: '14k' }, '')).toThrow(/“14k” is no whole number/);
  });

  it('knows a type of a newer server by its name', () => {
    expect(imuType('spacenav').words).toBe('spacenav');
    expect(imuSource('spacenav', {}, '')).toBe('type: spacenav');
  });
});

describe('commandPath', () => {
  it('keeps what was written, whatever characters are in it', () => {
    expect(commandPath({ name: 'next' })).toBe('next');
    const written = { source: 'type: line\nbaud: 1', part: 'a&b' };
    const path = commandPath({ name: 'imu', values: written });
    const values = new URL(path, 'http://x/').searchParams;
    expect([values.get('source'), values.get('part')]).toEqual(['type: line\nbaud: 1', 'a&b']);
  });
});
