// What the steps share: their contract, and small pieces of the page.
import { element, setText } from '../dom';
import type { SetupCommand } from './link';
import type { SetupState, StepVerdict } from './protocol';

/** The one large button. */
export interface Primary {
  words: string;
  /** Nothing is left to be done before it. */
  ready: boolean;
  /** Why it cannot be pressed; empty: it can. */
  blocked: string;
  /** What it sends, or in a sentence what is wrong with what was typed. */
  commands(): SetupCommand[] | string;
}

export type Tone = 'good' | 'warn' | 'bad';

/** What is asked and shown beside the picture in one step. */
export interface StepView {
  readonly root: HTMLElement;
  /** What a person shall do now, in large type; empty: what the step is for says it. */
  hint(state: SetupState): string;
  /** Of the hint; without it that of the verdict. */
  tone?(state: SetupState): Tone;
  update(state: SetupState): void;
  primary(state: SetupState): Primary;
}

export interface Desk {
  run(commands: SetupCommand[]): void;
  /** Something else is wanted of the primary button now. */
  changed(): void;
}

export const NEXT: SetupCommand = { name: 'next' };
export const AGAIN: SetupCommand = { name: 'again' };

export function next(words = 'Next', ready = true, blocked = ''): Primary {
  return { words, ready, blocked, commands: () => [NEXT] };
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

/** By colour and in words. */
export function judge(verdict: StepVerdict): JudgedStep {
  if (verdict.refused) return { tone: 'bad', words: 'Not usable' };
  if (verdict.good) return { tone: 'good', words: 'Good' };
  return { tone: 'warn', words: 'Usable, but not good' };
}

/** From two metres; empty without a verdict. */
export function verdictHint(verdict: StepVerdict | null): string {
  if (!verdict) return '';
  const { tone, words } = judge(verdict);
  const then = { good: ' Go on.', warn: '', bad: ' Read why.' }[tone];
  return `${words}.${then}`;
}

/** What came out of a step, and what to do about it. */
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

/** Of a step that ends with a verdict. @param before  it: what going on is called */
export function afterVerdict({ verdict, solving }: SetupState, before = 'Next'): Primary {
  if (solving) return next('Working it out …', false, 'The server is working it out.');
  // It may not be used: going on is not offered.
  if (verdict?.refused)
    return { words: 'Do it again', ready: true, blocked: '', commands: () => [AGAIN] };
  if (!verdict) return next(before, false);
  return verdict.good ? next() : next('Take it and go on');
}
