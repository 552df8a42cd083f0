// What is measured with a ruler: tags, and where the camera sits.
import { element, setText } from '../dom';
import {
  choice, column, labelled, NEXT, numberInput, type Desk, type Primary, type StepView,
} from './parts';
import type { SetupState } from './protocol';
import { isSimulated, plainNumber, printCommand, typedNumber } from './words';

const SIMULATED_MM = 400;
const RULER_MM = 100;
const DIRECTIONS = ['forward', 'back', 'left', 'right', 'up', 'down'] as const;

export class SheetView implements StepView {
  readonly root: HTMLElement;
  private readonly family = choice([]);
  private readonly size = numberInput('160');
  private readonly ruler = numberInput(String(RULER_MM));
  private readonly print = element('div');
  private readonly command = element('code', 'command');
  private readonly simulated = element('p', 'note-box');
  private isFilled = false;

  constructor(desk: Desk) {
    setText(
      this.simulated,
      `The tags of the simulated robot have edges of ${SIMULATED_MM} mm. Nothing is to be printed.`,
    );
    this.print.append(element('p', 'field-why', 'This prints twelve tags, one on each page:'));
    this.print.append(this.command);
    for (const input of [this.family, this.size])
      input.addEventListener('input', () => {
        this.showCommand();
        desk.changed();
      });
    this.root = column(
      this.simulated,
      this.print,
      labelled('Family of the tags', this.family, 'Other prints exist already? Choose theirs.'),
      labelled('Edge of the black square, mm', this.size, 'As the sheet says, not as measured.'),
      labelled('The printed ruler of 100 mm measures, mm', this.ruler,
        'Printers scale. Measure the ruler at the border of the sheet; leave 100 without one.'),
    );
  }

  hint(state: SetupState): string {
    return isSimulated(state) ? `The simulated tags are ${SIMULATED_MM} mm.` : '';
  }

  update(state: SetupState): void {
    const simulated = isSimulated(state);
    this.simulated.hidden = !simulated;
    this.print.hidden = simulated;
    if (this.isFilled) return;
    this.isFilled = true;
    const { family, families, sizeMm } = state.sheet;
    for (const name of families) this.family.add(new Option(name, name));
    this.family.value = family;
    this.size.value = simulated ? String(SIMULATED_MM) : plainNumber(sizeMm);
    this.showCommand();
  }

  primary(): Primary {
    const commands = (): ReturnType<Primary['commands']> => this.commands();
    return { words: 'These are my tags', ready: true, blocked: '', commands };
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

  private showCommand(): void {
    const size = typedNumber(this.size.value);
    setText(this.command, printCommand(this.family.value, plainNumber(size ?? 160)));
  }
}

export class MountView implements StepView {
  readonly root: HTMLElement;
  private readonly looks = choice(DIRECTIONS.map((name) => [name, name] as const));
  private readonly places = (['x', 'y', 'z'] as const).map(() => numberInput('0'));
  private readonly precision = element('p', 'note-box');

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
  }

  hint(): string {
    return '';
  }

  update(state: SetupState): void {
    const isLearned = state.steps.some((one) => one.name === 'wave' && !one.leftOut);
    setText(
      this.precision,
      isLearned
        ? 'A few centimetres are good enough: waving measures it.'
        : 'Measure well: without an IMU nothing corrects this.',
    );
  }

  primary(): Primary {
    return { words: 'It sits there', ready: true, blocked: '', commands: () => this.commands() };
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
