// Measured with a ruler: tags, and the place of the camera.
import { element, setText } from '../dom';
import { button } from '../map_commands';
import { keptWords, setupHeaders, TYPED_MOUNT } from './memory';
import {
  choice, column, labelled, NEXT, numberInput, type StepContext, type Primary, type StepView,
} from './parts';
import type { SetupState } from './protocol';
import { isSimulated, plainNumber, printCommand, typedNumber } from './words';

const SIMULATED_MM = 400;
const RULER_MM = 100;
// The place of its camera by a ruler; waving measures the rest.
const SIMULATED_MOUNT_M = ['0.1', '0', '-0.02'] as const;
const DIRECTIONS = ['forward', 'back', 'left', 'right', 'up', 'down'] as const;

export class SheetView implements StepView {
  readonly root: HTMLElement;
  private readonly family = choice([]);
  private readonly size = numberInput('160');
  private readonly ruler = numberInput(String(RULER_MM));
  private readonly paper = choice([['a4', 'A4'], ['letter', 'Letter'], ['a3', 'A3']]);
  private readonly print = element('div', 'controls');
  private readonly fault = element('p', 'fault');
  private readonly command = element('code', 'command');
  /** Which robot the fields were filled for; null: for none yet. */
  private filledFor: 'simulated' | 'real' | null = null;

  constructor(context: StepContext) {
    this.fault.setAttribute('role', 'alert');
    const row = element('div', 'field-row sheet-order');
    const get = button('Download the sheets', 'Twelve tags, PDF', () => void this.download());
    row.append(labelled('Paper', this.paper), get);
    const other = element('p', 'field-why', 'On the command line: ');
    other.append(this.command);
    this.print.append(row, this.fault, other);
    for (const input of [this.family, this.size, this.paper])
      input.addEventListener('input', () => {
        this.showCommand();
        context.changed();
      });
    this.root = column(
      labelled('Family of the tags', this.family, 'You have printed tags already? Choose their family.'),
      labelled('Edge of the black square, mm', this.size, 'As printed on the sheet, not as measured.'),
      this.print,
      labelled('The printed ruler of 100 mm measures, mm', this.ruler,
        'Printers scale. Measure the ruler at the border of the sheet; leave 100 without one.'),
    );
  }

  hint(state: SetupState): string {
    if (!isSimulated(state)) return '';
    return `Nothing to print: the simulated robot sees tags with edges of ${SIMULATED_MM} mm.`;
  }

  update(state: SetupState): void {
    const simulated = isSimulated(state);
    this.print.hidden = simulated;
    const robot = simulated ? 'simulated' : 'real';
    if (this.filledFor === robot) return;
    this.filledFor = robot;
    const { family, families, sizeMm } = state.sheet;
    this.family.replaceChildren(...families.map((name) => new Option(name, name)));
    this.family.value = family;
    this.size.value = simulated ? String(SIMULATED_MM) : plainNumber(sizeMm);
    this.showCommand();
  }

  primary(): Primary {
    const commands = (): ReturnType<Primary['commands']> => this.commands();
    return { words: 'Use these tags', ready: true, blocked: '', commands };
  }

  private commands(): ReturnType<Primary['commands']> {
    const size = typedNumber(this.size.value);
    const ruler = typedNumber(this.ruler.value);
    if (size === null || size <= 0)
      return `Edge of the black square: “${this.size.value}” is no length above 0 mm.`;
    if (ruler === null || ruler < 50 || ruler > 200)
      return `The ruler of 100 mm measures “${this.ruler.value}” mm? Expected 50 to 200.`;
    const values = {
      family: this.family.value,
      size_mm: plainNumber(size),
      ruler_mm: plainNumber(ruler),
    };
    return [{ name: 'sheet', values }, NEXT];
  }

  /** Twelve tags, PDF, or why there are none. */
  private async download(): Promise<void> {
    const order = { family: this.family.value, paper: this.paper.value };
    const size_mm = plainNumber(typedNumber(this.size.value) ?? 0);
    const query = new URLSearchParams({ ...order, size_mm }).toString();
    const url = new URL(`api/v1/setup/sheet?${query}`, document.baseURI);
    const answer = await fetch(url, { cache: 'no-store', headers: setupHeaders() }).catch(() => null);
    if (answer?.ok) return save(await answer.blob(), 'tags.pdf');
    setText(this.fault, (await answer?.text())?.trim() ?? 'The server did not answer.');
  }

  private showCommand(): void {
    setText(this.fault, '');
    const size = typedNumber(this.size.value);
    const { family, paper } = this;
    setText(this.command, printCommand(family.value, plainNumber(size ?? 160), paper.value));
  }
}

export class MountView implements StepView {
  readonly root: HTMLElement;
  private readonly looks = choice(DIRECTIONS.map((name) => [name, name] as const));
  private readonly places = (['x', 'y', 'z'] as const).map(() => numberInput('0'));
  private readonly precision = element('p', 'note-box');
  private isOfSimulated = false;

  constructor() {
    const row = element('div', 'field-row');
    const names = ['Forward, m', 'To the left, m', 'Up, m'];
    this.places.forEach((input, i) => row.append(labelled(names[i] ?? '', input)));
    this.root = column(
      labelled('The camera looks', this.looks, 'Seen from the robot: forward is where it drives.'),
      row,
      element('p', 'field-why', 'Behind, to the right and below are negative: −0.05.'),
      this.precision,
    );
    this.restore();
    this.root.addEventListener('input', () => this.keep());
  }

  hint(state: SetupState): string {
    if (!isSimulated(state)) return '';
    return 'The simulated robot is measured already. Continue.';
  }

  update(state: SetupState): void {
    if (isSimulated(state) !== this.isOfSimulated) this.fill(isSimulated(state));
    const isLearned = state.steps.some((one) => one.name === 'wave' && !one.leftOut);
    setText(
      this.precision,
      isLearned
        ? 'A few centimetres are good enough: waving measures it.'
        : 'Measure well: without an IMU nothing corrects this.',
    );
  }

  primary(): Primary {
    return { words: 'Use this place', ready: true, blocked: '', commands: () => this.commands() };
  }

  /** The input for another robot is void. */
  private fill(simulated: boolean): void {
    this.isOfSimulated = simulated;
    this.looks.value = 'forward';
    const values = simulated ? SIMULATED_MOUNT_M : ['0', '0', '0'];
    this.places.forEach((input, i) => (input.value = values[i] ?? '0'));
  }

  /** Measured values must survive a reload of the page. */
  private keep(): void {
    const typed = [this.looks.value, ...this.places.map((input) => input.value)];
    sessionStorage.setItem(TYPED_MOUNT, JSON.stringify(typed));
  }

  private restore(): void {
    const typed = keptWords(sessionStorage.getItem(TYPED_MOUNT));
    [this.looks, ...this.places].forEach((input, i) => (input.value = typed[i] ?? input.value));
  }

  private commands(): ReturnType<Primary['commands']> {
    const values: Record<string, string> = {};
    for (const [i, axis] of (['x', 'y', 'z'] as const).entries()) {
      const typed = this.places[i]?.value ?? '';
      const metres = typedNumber(typed.replace('−', '-'));
      if (metres === null) return `${axis}: “${typed}” is no number of metres.`;
      if (Math.abs(metres) > 10) return `${axis} = ${typed} m: is that in metres?`;
      values[`${axis}_m`] = String(metres);
    }
    values.looks = this.looks.value;
    return [{ name: 'mount', values }, NEXT];
  }
}

function save(content: Blob, name: string): void {
  const link = element('a');
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
