import { element } from './dom';

export interface Question {
  title: string;
  /** Consequences. */
  text: string;
  /** Label of the confirming button. */
  yes: string;
  /** A text field; without it the question is yes or no. */
  field?: { label: string; lines?: number; placeholder?: string; required?: boolean; secret?: boolean };
  /** @returns the fault of the typed text; empty: none */
  check?: (typed: string) => string;
}

/** A dialog over the page. @returns the typed text (empty without a field); null: no */
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
  else if (field.secret) {
    input.type = 'password';
    input.autocomplete = 'off';
  }
  input.placeholder = field.placeholder ?? '';
  input.required = field.required ?? false;
  return input;
}
