import { element, setText } from '../dom';
import { column, type Primary, type StepContext, type StepView } from './parts';
import type { SetupState } from './protocol';

export class FinishView implements StepView {
  readonly root: HTMLElement;
  private readonly where = element('p', 'note-box');
  private readonly yaml = element('pre', 'configuration');
  private readonly replace = element('input');
  private readonly label = element('label', 'check');

  constructor(context: StepContext) {
    this.yaml.tabIndex = 0;
    this.yaml.setAttribute('aria-label', 'The configuration');
    this.replace.type = 'checkbox';
    this.replace.addEventListener('change', () => context.changed());
    this.label.append(this.replace, element('span', '', 'Replace the file that is there'));
    this.root = column(this.where, this.yaml, this.label);
  }

  hint(): string {
    return '';
  }

  update(state: SetupState): void {
    setText(this.where, `It is written to ${state.file}.`);
    setText(this.yaml, state.configuration);
    this.label.hidden = !state.exists || state.written;
  }

  primary(state: SetupState): Primary {
    if (state.written) return this.button('Written', 'The server starts with it.');
    const isRefused = state.exists && !this.replace.checked;
    return this.button('Write and start', isRefused ? `${state.file} is there already.` : '');
  }

  private button(words: string, blocked: string): Primary {
    const values: Record<string, string> = {};
    if (this.replace.checked) values.replace = 'yes';
    return { words, ready: true, blocked, commands: () => [{ name: 'write', values }] };
  }
}
