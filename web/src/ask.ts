import { element } from './dom';

export interface Question {
  title: string;
  /** What will happen. */
  text: string;
  /** On the button that does it. */
  yes: string;
  /** Something to be typed; without it only yes or no is asked. */
  field?: { label: string; lines?: number; placeholder?: string; required?: boolean };
  /** @returns what is wrong with what was typed; empty: nothing */
  check?: (typed: string) => string;
}

/** A dialog over the page. @returns what was typed (empty without a field); null: no */
export function ask(question: Question): Promise<string | null> {
  const dialog = element('dialog', 'ask');
  const form = element('form');
  const fault = element('p', 'fault');
  fault.setAttribute('role', 'alert');
  const input = question.field ? inputOf(question.field) : null;
  const no = element('button', '', 'Cancel');
  no.type = 'button';
  const yes = element('button', 'yes', question.yes);
  const buttons = element('div', 'buttons');
  buttons.append(no, yes);
  form.append(element('h2', '', question.title), element('p', '', question.text));
  if (input && question.field) {
    const label = element('label', '', question.field.label);
    label.append(input);
    form.append(label);
  }
  form.append(fault, buttons);
  dialog.append(form);
  document.body.append(dialog);
  return new Promise((resolve) => {
    let answer: string | null = null;
    dialog.addEventListener('close', () => {
      dialog.remove();
      resolve(answer);
    });
    no.addEventListener('click', () => dialog.close());
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      const typed = (input?.value ?? '').trim();
      const wrong = question.check?.(typed) ?? '';
      fault.textContent = wrong;
      if (wrong) return;
      answer = typed;
      dialog.close();
    });
    dialog.showModal();
    (input ?? no).focus();
  });
}

function inputOf(field: NonNullable<Question['field']>): HTMLInputElement | HTMLTextAreaElement {
  const input = field.lines ? element('textarea') : element('input');
  if (input instanceof HTMLTextAreaElement) input.rows = field.lines ?? 1;
  input.placeholder = field.placeholder ?? '';
  input.required = field.required ?? false;
  return input;
}
