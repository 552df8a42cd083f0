// What the steps share: their contract, and small pieces of the page.
import { element, setText } from '../dom';
import type { SetupCommand } from './link';
import type { SetupState, StepVerdict } from './protocol';

/** The one large button. */
export interface Primary {
  words: string;
  /** All conditions for it are met. */
  ready: boolean;
  /** Why it cannot be pressed; empty: it can. */
  blocked: string;
  /** Nothing but the next step. */
  isNext?: boolean;
  /** The commands it sends, or the fault of the input. */
  commands(): SetupCommand[] | string;
}

export type Tone = 'good' | 'warn' | 'bad';

/** Questions and values beside the picture in one step. */
export interface StepView {
  readonly root: HTMLElement;
  /** Instruction for the user, in large type; empty: that of the step. */
  hint(state: SetupState): string;
  /** Of the hint; without it that of the verdict. */
  tone?(state: SetupState): Tone;
  update(state: SetupState): void;
  primary(state: SetupState): Primary;
}

export interface StepContext {
  run(commands: SetupCommand[]): void;
  /** The primary button has changed. */
  changed(): void;
}

export const NEXT: SetupCommand = { name: 'next' };
export const AGAIN: SetupCommand = { name: 'again' };

/** Blocked while the server would refuse it. */
export function ifComplete(primary: Primary, { missing }: SetupState): Primary {
  if (!primary.isNext || primary.blocked !== '' || missing === '') return primary;
  return { ...primary, blocked: `${missing[0]?.toUpperCase()}${missing.slice(1)}.` };
}

export function next(words = 'Next', ready = true, blocked = ''): Primary {
  return { words, ready, blocked, isNext: true, commands: () => [NEXT] };
}

export function column(...parts: HTMLElement[]): HTMLElement {
  const made = element('div', 'controls');
  made.append(...parts);
  return made;
}

export function labelled(words: string, input: HTMLElement, explained = ''): HTMLLabelElement {
  const label = element('label', 'field');
  label.append(element('span', 'field-name', words), input);
  if (explained) label.append(element('span', 'field-why', explained));
  return label;
}

export function textInput(value: string, placeholder = ''): HTMLInputElement {
  const input = element('input');
  input.value = value;
  input.placeholder = placeholder;
  input.autocomplete = 'off';
  input.spellcheck = false;
  return input;
}

/** Also of phones: with digits to type on. */
export function numberInput(value: string): HTMLInputElement {
  const input = textInput(value);
  input.inputMode = 'decimal';
  return input;
}

/** @param options  value and words */
export function choice(options: readonly (readonly [string, string])[]): HTMLSelectElement {
  const select = element('select');
  for (const [value, words] of options) {
    const option = element('option', '', words);
    option.value = value;
    select.append(option);
  }
  return select;
}

/** A share of what is needed, with its words. */
export class Progress {
  readonly root = element('label', 'progress');
  private readonly bar = element('progress');
  private readonly value = element('span', 'number');

  constructor(words: string) {
    this.bar.max = 1;
    const head = element('span', 'progress-head');
    head.append(element('span', '', words), this.value);
    this.root.append(head, this.bar);
  }

  set(share: number, words = ''): void {
    const shown = Math.min(1, Math.max(0, share));
    this.bar.value = shown;
    this.root.dataset.done = String(shown >= 1);
    setText(this.value, words || (shown >= 1 ? 'done' : `${Math.floor(100 * shown)} %`));
  }
}

export interface JudgedStep {
  tone: Tone;
  words: string;
}

/** By colour and as text. */
export function judge(verdict: StepVerdict): JudgedStep {
  if (verdict.refused) return { tone: 'bad', words: 'Not usable' };
  if (verdict.good) return { tone: 'good', words: 'Good' };
  return { tone: 'warn', words: 'Usable, but not good' };
}

/** From two metres; empty without a verdict. */
export function verdictHint(verdict: StepVerdict | null): string {
  if (!verdict) return '';
  const { tone, words } = judge(verdict);
  const then = { good: ' Continue.', warn: '', bad: ' Read why.' }[tone];
  return `${words}.${then}`;
}

/** Result of a step, with advice. */
export class VerdictBox {
  readonly root = element('section', 'setup-verdict');
  private readonly title = element('h3');
  private readonly summary = element('p');
  private readonly advice = element('ul');
  private shown = '';

  constructor() {
    this.root.setAttribute('aria-label', 'Verdict');
    this.root.setAttribute('role', 'status');
    this.root.append(this.title, this.summary, this.advice);
    this.root.hidden = true;
  }

  show(verdict: StepVerdict | null): void {
    const key = JSON.stringify(verdict);
    if (key === this.shown) return;
    this.shown = key;
    this.root.hidden = verdict === null;
    if (!verdict) return;
    const { tone, words } = judge(verdict);
    this.root.dataset.verdict = tone;
    setText(this.title, words);
    setText(this.summary, verdict.summary);
    this.advice.replaceChildren(...verdict.advice.map((line) => element('li', '', line)));
  }
}

/** Of a step that ends with a verdict. @param before  label of the button before there is one */
export function afterVerdict({ verdict, solving }: SetupState, before = 'Next'): Primary {
  if (solving) return next('Computing …', false, 'The server is computing the result.');
  // It may not be used: there is no way to continue.
  if (verdict?.refused)
    return { words: 'Repeat it', ready: true, blocked: '', commands: () => [AGAIN] };
  if (!verdict) return next(before, false);
  return verdict.good ? next() : next('Accept and continue');
}
