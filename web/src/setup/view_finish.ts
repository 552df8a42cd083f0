import { element, setText } from '../dom';
import { column, type Primary, type StepView } from './parts';
import type { SetupState } from './protocol';

export class FinishView implements StepView {
  readonly root: HTMLElement;
  private readonly where = element('p', 'note-box');
  private readonly yaml = element('pre', 'configuration');
  private readonly replace = element('input');

  constructor() {
    this.yaml.tabIndex = 0;
    this.yaml.setAttribute('aria-label', 'The configuration');
    this.replace.type = 'checkbox';
    const label = element('label', 'check');
    label.append(this.replace, element('span', '', 'Replace the file if there is one already'));
    this.root = column(this.where, this.yaml, label);
  }

  hint(): string {
    return '';
  }

  update(state: SetupState): void {
    setText(this.where, `It is written to ${state.file}.`);
    setText(this.yaml, state.configuration);
  }

  primary(state: SetupState): Primary {
    if (state.written) return this.button('Written', 'The server starts with it.');
    return this.button('Write it and start', '');
  }

  private button(words: string, blocked: string): Primary {
    const values: Record<string, string> = {};
    if (this.replace.checked) values.replace = 'yes';
    return { words, ready: true, blocked, commands: () => [{ name: 'write', values }] };
  }
}
