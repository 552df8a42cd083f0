import { ask } from './ask';
import type { Command } from './control_codec';
import { element, setText } from './dom';
import { parsePlaces } from './measured_places';
import { command, type Outcome } from './operator';
import { OriginDialog } from './origin_dialog';
import type { MapTag, MapVersion, ServerEvent } from './protocol';

const NO_COMMANDS = 'This server takes no commands: set operator.token or operator.token_file in its configuration.';
const LOCKED = 'Locked. Changes need the token.';
const TOKEN =
  'The token stays in this tab; only a proof that you know it is sent. But an attacker that can alter a page that comes by plain http ' +
  'can take it: behind a network you do not trust, use https or a tunnel.';
const OPEN = 'Unlocked in this tab.';

type Tone = '' | 'busy' | 'good' | 'bad';

/** Changes of the map by an operator: the token, the buttons, and the results as text. */
export class MapCommands {
  readonly head = element('div', 'operator');
  private readonly why = element('p', 'why');
  private readonly form = element('form', 'token');
  private readonly typed = element('input');
  private readonly lock = button('Lock', 'Forget the token', () => this.forgetToken());
  private readonly mode = button('Freeze', '', () => void this.changeMode());
  private readonly outcome = element('p', 'outcome');
  private readonly gates: HTMLFieldSetElement[] = [];
  private key: string | null = null;
  private takesCommands = false;
  private isFrozen = false;
  private tags: readonly MapTag[] = [];
  private events: ServerEvent[] = [];
  private awaited: { after: number; kinds: string[] } | null = null;

  /** @param url  of the control channel */
  constructor(
    private readonly url: string,
    private readonly send: typeof command = command,
  ) {
    this.typed.type = 'password';
    this.typed.autocomplete = 'off';
    this.typed.placeholder = 'Operator’s token';
    this.typed.title = TOKEN;
    this.typed.setAttribute('aria-label', 'Operator’s token');
    this.form.append(this.typed, element('button', '', 'Unlock'));
    this.form.addEventListener('submit', (event) => {
      event.preventDefault();
      void this.unlock();
    });
    this.outcome.setAttribute('role', 'status');
    const line = element('div', 'access');
    line.append(this.why, this.form, this.lock);
    const deeds = this.gated(
      this.mode,
      button('Commit…', 'Store the map as it is now as a version', () => void this.commit()),
      button('Origin…', 'Set the origin of the room: by dragging, by three tags, or by measured places', () => void this.align()),
    );
    this.head.append(line, deeds, this.outcome);
    this.show();
  }

  /** Once it was typed; stays in the page. */
  get token(): string | null {
    return this.key;
  }

  get isUnlocked(): boolean {
    return this.takesCommands && this.key !== null;
  }

  /** A function that needs the token was chosen. */
  askForToken(): void {
    this.typed.focus();
  }

  /** Buttons that need the token. */
  gated(...buttons: HTMLButtonElement[]): HTMLFieldSetElement {
    const made = element('fieldset', 'deeds');
    made.append(...buttons);
    this.gates.push(made);
    this.show();
    return made;
  }

  /** @param mode  of the map: `mapping` or `frozen` */
  setServer(takesCommands: boolean, mode: string): void {
    this.takesCommands = takesCommands;
    this.isFrozen = mode === 'frozen';
    setText(this.mode, this.isFrozen ? 'Let it grow' : 'Freeze');
    this.mode.title = this.isFrozen ? 'New tags join again, and places are refined' : 'Nothing in the map moves any more';
    this.show();
  }

  /** The map as it is served. */
  setMap(tags: readonly MapTag[]): void {
    this.tags = tags;
  }

  /** Events of the server, which include the results of commands. */
  heard(events: ServerEvent[]): void {
    this.events = events;
    this.look();
  }

  async name(version: MapVersion): Promise<void> {
    const name = await ask({
      title: `Name version ${version.version}`,
      text: 'A version with a name is never thinned out.',
      yes: 'Name it',
      field: { label: 'Name', placeholder: version.comment, required: true },
    });
    if (name !== null) await this.run({ do: 'name', version: version.version, name }, `Naming version ${version.version}`, ['version_named']);
  }

  async rollBack(version: MapVersion, newest: number): Promise<void> {
    const text =
      `The ${version.tags} tags of version ${version.version} are served again, as a new version after ${newest}. ` +
      'The present map is stored before, so nothing is lost. Bodies adopt the old places with their next images; their poses may move.';
    const title = `Roll back to version ${version.version}?`;
    if ((await ask({ title, text, yes: `Roll back to ${version.version}` })) === null) return;
    await this.run({ do: 'rollback', version: version.version }, `Rolling back to version ${version.version}`, ['rolled_back']);
  }

  async quarantine(tag: number): Promise<void> {
    const text = `It stays in the map, and no body uses it any more, until it is forgotten or another version is served.`;
    if ((await ask({ title: `Quarantine tag ${tag}?`, text, yes: `Quarantine ${tag}` })) === null) return;
    await this.run({ do: 'quarantine', tag }, `Quarantining tag ${tag}`, ['tag_quarantined']);
  }

  async forget(tag: number): Promise<void> {
    const text = 'Map and bodies discard it; seen again, it is a new tag. Stored versions keep it.';
    if ((await ask({ title: `Forget tag ${tag}?`, text, yes: `Forget ${tag}` })) === null) return;
    await this.run({ do: 'forget', tag }, `Forgetting tag ${tag}`, ['tag_forgotten']);
  }

  private async commit(): Promise<void> {
    const name = await ask({
      title: 'Store the map as a version',
      text: 'Versions stored by an operator are never thinned out.',
      yes: 'Commit',
      field: { label: 'Name (may be empty)', placeholder: 'before the fair' },
    });
    if (name !== null) await this.run({ do: 'commit', name }, 'Storing the map', ['version_stored', 'not_stored']);
  }

  /** Sets the origin: on a plan of the map, or by measured places. */
  async align(): Promise<void> {
    const chosen = await new OriginDialog(this.tags).ask();
    if (chosen === 'measured') return this.alignMeasured();
    if (chosen !== null) await this.run({ do: 'align', places: chosen }, 'Moving the origin', ['aligned']);
  }

  private async alignMeasured(): Promise<void> {
    const check = (typed: string): string => {
      try {
        return parsePlaces(typed) && '';
      } catch (error) {
        return (error as Error).message;
      }
    };
    const typed = await ask({
      title: 'Align the map to the room',
      text: 'Three tags or more whose centres were measured in the room: a line for each, its id and x y z in metres, z up. Streamed poses jump into these axes, once.',
      yes: 'Align',
      field: { label: 'Measured tags', lines: 5, placeholder: '0  0.00 0.00 0.00\n1  2.40 0.00 0.00\n7  0.00 3.60 1.20', required: true },
      check,
    });
    if (typed !== null) await this.run({ do: 'align', places: parsePlaces(typed) }, 'Aligning', ['aligned']);
  }

  freeze(): Promise<void> {
    return this.run({ do: 'freeze' }, 'Freezing the map', ['frozen']);
  }

  private changeMode(): Promise<void> {
    return this.isFrozen ? this.run({ do: 'grow' }, 'Letting the map grow', ['mapping']) : this.freeze();
  }

  private async unlock(): Promise<void> {
    const typed = this.typed.value;
    if (typed === '') return;
    this.say('busy', 'Asking the server …');
    const outcome = await this.send(this.url, typed, { do: 'check' });
    this.say(outcome.done ? '' : 'bad', outcome.done ? '' : `Not unlocked: ${outcome.text}.`);
    if (!outcome.done) return;
    this.key = typed;
    this.typed.value = '';
    this.show();
  }

  private forgetToken(): void {
    this.key = null;
    this.say('', '');
    this.show();
  }

  /** @param kinds  of the events that report the result */
  private async run(wanted: Command, doing: string, kinds: string[]): Promise<void> {
    if (this.key === null) return;
    this.awaited = null;
    const after = this.newest();
    this.say('busy', `${doing} …`);
    const outcome: Outcome = await this.send(this.url, this.key, wanted);
    if (outcome.forbidden) this.forgetToken();
    if (!outcome.done) return this.say('bad', `Refused: ${outcome.text}.`);
    this.awaited = { after, kinds: [...kinds, 'refused'] };
    this.look();
  }

  private look(): void {
    const { awaited } = this;
    if (!awaited) return;
    const outcome = this.events.find((event) => event.n > awaited.after && event.subject === 'map' && awaited.kinds.includes(event.kind));
    if (!outcome) return;
    this.awaited = null;
    this.say(outcome.severity === 'info' ? 'good' : 'bad', eventWords(outcome));
  }

  private newest(): number {
    return this.events.reduce((most, event) => Math.max(most, event.n), 0);
  }

  private say(tone: Tone, words: string): void {
    this.outcome.dataset.tone = tone;
    setText(this.outcome, words);
  }

  private show(): void {
    const isOpen = this.isUnlocked;
    const why = !this.takesCommands ? NO_COMMANDS : isOpen ? OPEN : LOCKED;
    setText(this.why, why);
    this.form.hidden = !this.takesCommands || isOpen;
    this.lock.hidden = !isOpen;
    for (const gate of this.gates) {
      gate.disabled = !isOpen;
      gate.title = isOpen ? '' : why;
    }
  }
}

/** `The map was rolled back to …`, `Tag 7 is not used any more …`; with the remedy, when there is one. */
export function eventWords({ text, remedy }: ServerEvent): string {
  const own = /^(the map|tags?|versions?|not) /.test(text);
  const sentence = own ? text.charAt(0).toUpperCase() + text.slice(1) : `The map ${text}`;
  return remedy === '' ? `${sentence}.` : `${sentence}. ${remedy}.`;
}

export function button(words: string, title: string, act: () => void): HTMLButtonElement {
  const made = element('button', '', words);
  made.type = 'button';
  made.title = title;
  made.addEventListener('click', act);
  return made;
}
