import type { MeasuredPlace } from './control_codec';
import { element, setText } from './dom';
import { PICKS, PICK_WORDS, picked, placesFor, UNCHANGED, usableTags, type Origin } from './origin';
import { OriginPlan } from './origin_plan';
import type { MapTag } from './protocol';

const FIELDS: { key: keyof Origin; words: string; step: number }[] = [
  { key: 'x', words: 'x, m', step: 0.01 },
  { key: 'y', words: 'y, m', step: 0.01 },
  { key: 'z', words: 'z, m', step: 0.01 },
  { key: 'turn', words: 'turned by, °', step: 0.1 },
];

/** Result: places for the server, or the choice to type measured ones; null: cancelled. */
export type Chosen = MeasuredPlace[] | 'measured' | null;

/** The origin: dragged on a plan, picked by three tags, or entered. */
export class OriginDialog {
  private readonly dialog = element('dialog', 'ask origin');
  private readonly hint = element('p', 'origin-hint');
  private readonly fault = element('p', 'fault');
  private readonly inputs = new Map<keyof Origin, HTMLInputElement>();
  private readonly plan: OriginPlan;
  private origin: Origin = UNCHANGED;
  private pick = 0;
  private chosen: Chosen = null;

  constructor(private readonly tags: readonly MapTag[]) {
    this.plan = new OriginPlan(
      usableTags(tags),
      this.origin,
      (origin) => this.set(origin),
      (tag) => this.point(tag),
    );
    this.fault.setAttribute('role', 'alert');
    const form = element('form');
    form.noValidate = true; // steps are for the arrow keys, they do not limit the input
    const side = element('div', 'origin-side');
    side.append(this.hint, this.fields(), this.fault);
    const middle = element('div', 'origin-middle');
    middle.append(this.plan.svg, side);
    form.append(
      element('h2', '', 'Where is the origin of the room?'),
      element('p', '', 'The vertical is known by gravity. From then on clients get poses and tags in these axes: streamed poses jump there once.'),
      middle,
      this.buttons(),
    );
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      this.apply();
    });
    this.dialog.append(form);
    this.showHint();
  }

  ask(): Promise<Chosen> {
    document.body.append(this.dialog);
    this.dialog.showModal();
    return new Promise((resolve) => {
      this.dialog.addEventListener('close', () => {
        this.dialog.remove();
        resolve(this.chosen);
      });
    });
  }

  private fields(): HTMLElement {
    const list = element('div', 'origin-fields');
    for (const { key, words, step } of FIELDS) {
      const label = element('label', '', words);
      const input = element('input');
      input.type = 'number';
      input.step = String(step);
      input.value = '0';
      input.name = key;
      input.addEventListener('input', () => {
        if (input.value === '' || !Number.isFinite(input.valueAsNumber)) return;
        this.origin = { ...this.origin, [key]: input.valueAsNumber };
        this.plan.show(this.origin);
      });
      this.inputs.set(key, input);
      label.append(input);
      list.append(label);
    }
    return list;
  }

  private buttons(): HTMLElement {
    const row = element('div', 'buttons');
    const add = (words: string, act: () => void): void => {
      const one = element('button', '', words);
      one.type = 'button';
      one.addEventListener('click', act);
      row.append(one);
    };
    add('I have measured places…', () => {
      this.chosen = 'measured';
      this.dialog.close();
    });
    add('Cancel', () => this.dialog.close());
    row.append(element('button', 'yes', 'This is the origin'));
    return row;
  }

  private set(origin: Origin): void {
    this.origin = origin;
    for (const { key, step } of FIELDS) {
      const input = this.inputs.get(key);
      if (input) input.value = origin[key].toFixed(step < 0.1 ? 3 : 1);
    }
  }

  private point(tag: MapTag): void {
    const pick = PICKS[this.pick % PICKS.length] ?? 'origin';
    this.set(picked(this.origin, pick, tag));
    this.plan.show(this.origin);
    this.pick += 1;
    this.showHint();
  }

  private showHint(): void {
    const pick = PICKS[this.pick % PICKS.length] ?? 'origin';
    setText(this.hint, `Drag the origin and the tip of x, enter numbers, or click at ${PICK_WORDS[pick]}.`);
    this.dialog.dataset.pick = pick;
  }

  private apply(): void {
    const empty = FIELDS.find(({ key }) => !Number.isFinite(this.inputs.get(key)?.valueAsNumber));
    if (empty) return setText(this.fault, `“${empty.words}” is no number.`);
    try {
      this.chosen = placesFor(this.origin, this.tags);
      this.dialog.close();
    } catch (error) {
      setText(this.fault, `${(error as Error).message}.`);
    }
  }
}
