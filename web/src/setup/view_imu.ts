import { element, setText } from '../dom';
import { fixed } from '../format';
import { button } from '../map_commands';
import { imuSource, imuType } from './imu_source';
import {
  choice, column, labelled, NEXT, next, textInput, type StepContext, type Primary, type StepView,
} from './parts';
import type { Imu, SetupState } from './protocol';

const NONE = 'none';
const AXES = [
  ['', 'As the robot: x forward, y left, z up'],
  ['flu', 'flu: x forward, y left, z up'],
  ['frd', 'frd: x forward, y right, z down'],
  ['camera', 'camera: x right, y down, z out of the lens'],
] as const;

export class ImuView implements StepView {
  readonly root: HTMLElement;
  private readonly kinds = element('div', 'choices');
  private readonly form = element('div', 'controls');
  private readonly inputs = new Map<string, HTMLInputElement>();
  private readonly part = choice([['', 'I do not know']]);
  private readonly axes = choice(AXES);
  private readonly simulated = element('p', 'note-box');
  private imu: Imu | null = null;
  private chosen = '';
  /** The last sent values; the input may differ. */
  private sent: string | null = null;

  constructor(private readonly context: StepContext) {
    this.kinds.setAttribute('role', 'group');
    this.kinds.setAttribute('aria-label', 'Where the IMU’s samples come from');
    setText(this.simulated, 'The simulated robot has an IMU: there is nothing to connect.');
    this.form.addEventListener('input', () => context.changed());
    this.root = column(this.simulated, this.kinds, this.form);
  }

  hint({ imu }: SetupState): string {
    if (!imu || !this.isConnected()) return '';
    if (imu.rateHz === 0) return 'Connected, but no sample has come yet.';
    return `The IMU delivers ${fixed(imu.rateHz, 0)} samples a second.`;
  }

  update({ imu }: SetupState): void {
    const isFirst = this.imu === null && imu !== null;
    this.imu = imu;
    if (!imu) return;
    if (isFirst) this.lay(imu);
    this.simulated.hidden = !imu.simulated;
    this.kinds.hidden = this.form.hidden = imu.simulated;
  }

  primary(): Primary {
    const { imu } = this;
    if (!imu) return next('Next', false, 'Waiting for the server.');
    if (imu.simulated || this.isConnected()) return next('Next', !imu.used || imu.rateHz > 0);
    if (this.chosen === NONE) {
      const commands = [{ name: 'imu', values: { source: '' } }, NEXT];
      return { words: 'Continue without IMU', ready: true, blocked: '', commands: () => commands };
    }
    const blocked = this.chosen === '' ? 'Choose where the samples come from.' : '';
    return { words: 'Connect', ready: true, blocked, commands: () => this.connect() };
  }

  private isConnected(): boolean {
    return this.imu?.used === true && this.sent === this.written();
  }

  /** The values of the input, without checks. */
  private written(): string {
    const typed = [...this.inputs].map(([key, input]) => `${key}=${input.value}`);
    return [this.chosen, ...typed, this.part.value, this.axes.value].join('|');
  }

  private lay(imu: Imu): void {
    for (const part of imu.parts) this.part.add(new Option(part, part));
    const kinds: [string, string, string][] = imu.types.map((name) => {
      const { words, explained } = imuType(name);
      return [name, words, explained];
    });
    kinds.push([NONE, 'No IMU', 'Camera alone: slower to react, and blind without tags in view.']);
    for (const [name, words, explained] of kinds) {
      const made = button('', '', () => this.choose(name));
      made.className = 'choice';
      made.dataset.type = name;
      made.setAttribute('aria-pressed', 'false');
      made.append(element('span', 'choice-name', words));
      if (explained) made.append(element('span', 'choice-detail', explained));
      this.kinds.append(made);
    }
    // When the user returns to this step, the source stays connected until the input changes.
    if (imu.used) this.sent = this.written();
  }

  private choose(name: string): void {
    this.chosen = name;
    for (const one of this.kinds.querySelectorAll('button'))
      one.setAttribute('aria-pressed', String(one.dataset.type === name));
    this.inputs.clear();
    this.form.replaceChildren();
    if (name !== NONE) this.layForm(name);
    this.context.changed();
  }

  private layForm(name: string): void {
    const type = imuType(name);
    for (const { key, words, usual, isNumber } of type.fields) {
      const input = textInput(usual);
      if (isNumber) input.inputMode = 'numeric';
      this.inputs.set(key, input);
      this.form.append(labelled(words, input));
    }
    this.form.append(labelled('Part', this.part, 'Its noise and range come from its data sheet.'));
    if (type.hasAxes) this.form.append(labelled('Axes', this.axes, 'As they are printed on it.'));
  }

  private connect(): ReturnType<Primary['commands']> {
    const typed = Object.fromEntries([...this.inputs].map(([key, input]) => [key, input.value]));
    try {
      const values: Record<string, string> = {
        source: imuSource(this.chosen, typed, this.axes.value),
      };
      if (this.part.value !== '') values.part = this.part.value;
      this.sent = this.written();
      return [{ name: 'imu', values }];
    } catch (error) {
      return (error as Error).message;
    }
  }
}
