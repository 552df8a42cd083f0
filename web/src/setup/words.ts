import { fixed, plural } from '../format';
import type { SetupState, StepName } from './protocol';

export interface StepWords {
  /** In the list. */
  short: string;
  title: string;
  /** Instruction, in a sentence or two. */
  todo: string;
}

export const STEP_WORDS: Record<StepName, StepWords> = {
  camera: {
    short: 'Camera',
    title: 'Choose the camera',
    todo: 'Plug in the camera of the robot and choose it. Its picture shows here.',
  },
  picture: {
    short: 'Exposure and focus',
    title: 'Set exposure and focus',
    todo: 'Expose as short as the light allows, then turn the lens until the edges are sharp.',
  },
  sheet: {
    short: 'Tags',
    title: 'Print tags and measure them',
    todo: 'Print the sheets at 100 %, glue them onto something flat, and measure with a ruler.',
  },
  lens: {
    short: 'Lens',
    title: 'Calibrate the lens',
    todo: 'Hold a sheet before the camera, and show it everywhere in the picture, also tilted.',
  },
  imu: {
    short: 'IMU',
    title: 'Connect the IMU',
    todo: 'The IMU measures how the robot turns and accelerates. Without one it works, too.',
  },
  rest: {
    short: 'At rest',
    title: 'Let the robot lie still',
    todo: 'The noise of the IMU is measured while nothing moves.',
  },
  mount: {
    short: 'Mounting',
    title: 'Where is the camera on the robot?',
    todo: 'Measure from the middle of the robot (its IMU, where it has one) to the lens.',
  },
  wave: {
    short: 'Wave',
    title: 'Wave the robot',
    todo: 'Turn and shake it before the tags: that calibrates camera and IMU against each other.',
  },
  finish: {
    short: 'Configuration',
    title: 'Write the configuration',
    todo: 'Check it. The server then starts with it, without a restart.',
  },
};

export type StepMark = 'done' | 'current' | 'open' | 'left out' | 'skipped';

export interface ListedStep {
  name: StepName;
  mark: StepMark;
}

/** What is before the current step is done, or was skipped. */
export function listSteps(state: SetupState): ListedStep[] {
  const at = state.steps.findIndex((one) => one.name === state.step);
  return state.steps.map(({ name, leftOut, skipped }, i) => {
    const before = leftOut ? 'left out' : skipped ? 'skipped' : i < at ? 'done' : 'open';
    return { name, mark: i === at ? 'current' : before };
  });
}

/** `Step 3 of 7`, without those that are left out. */
export function progressWords(state: SetupState): string {
  const taken = listSteps(state).filter((one) => one.mark !== 'left out');
  const at = taken.findIndex((one) => one.mark === 'current');
  return `Step ${at + 1} of ${taken.length}`;
}

/** Result of a finished step, from the state; else the remembered one. */
export function doneWords(state: SetupState, name: StepName, remembered: string): string {
  switch (name) {
    case 'camera':
      return cameraName(state);
    case 'sheet':
      return `${state.sheet.family}, ${plainNumber(state.sheet.sizeMm)} mm`;
    case 'imu':
      if (!state.imu) return remembered;
      return state.imu.used ? `${fixed(state.imu.rateHz, 0)} samples a second` : 'None';
    // Their figures are long, and are in the configuration.
    case 'rest':
    case 'wave':
      return 'measured';
    default:
      return remembered;
  }
}

/** Result of the present step to be remembered. */
export function summaryNow(state: SetupState): string {
  if (state.step === 'picture') return state.picture?.verdict ?? '';
  return state.verdict?.summary ?? '';
}

export function cameraName({ camera, cameras }: SetupState): string {
  if (!camera) return '';
  return cameras.find((one) => one.open === camera.open)?.name ?? camera.open;
}

export const isSimulated = (state: SetupState): boolean => state.camera?.open === 'simulated';

export function pictureFacts(state: SetupState): string {
  const { picture } = state;
  if (!state.camera) return 'No camera is chosen yet.';
  if (!picture) return 'Waiting for the first picture …';
  const tags = plural(picture.outlines.length, 'tag', 'tags');
  const rate = `${fixed(picture.rateHz, 1)} images/s`;
  return `${picture.width} × ${picture.height} · ${rate} · ${tags} seen`;
}

/** `robot.token` beside the configuration. */
export function tokenFile(configuration: string): string {
  const slash = configuration.lastIndexOf('/') + 1;
  const name = configuration.slice(slash).replace(/\.[^.]+$/, '');
  return `${configuration.slice(0, slash)}${name}.token`;
}

/** 160, 62.5: as a person writes it. */
export function plainNumber(value: number): string {
  return String(Math.round(value * 1000) / 1000);
}

/** The command that prints the sheets. */
export function printCommand(family: string, sizeMm: string, paper: string): string {
  const other = family === 'tag36h11' ? '' : ` --family ${family}`;
  const on = paper === 'a4' ? '' : ` --paper ${paper}`;
  return `fiducap tags sheet --ids 0-11 --size-mm ${sizeMm}${other}${on} --out tags.pdf`;
}

/** What is typed as a number, also with a comma. @returns null: it is none */
export function typedNumber(typed: string): number | null {
  const value = Number(typed.trim().replace(',', '.'));
  return typed.trim() === '' || !Number.isFinite(value) ? null : value;
}
