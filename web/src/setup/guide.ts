import { element, setText } from '../dom';
import { button, type MapCommands } from '../map_commands';
import type { BodyFrame, Hello, LogLine, ServerEvent } from '../protocol';
import {
  GUIDE_STEPS, GUIDE_WORDS, isMapped, movingWords, servedBy, type GuideStep,
} from './guide_words';
import { forget, remember, type SecondHalf } from './memory';
import { tokenFile } from './words';
import './guide.css';

const MOST_LINES = 50; // a new socket repeats them

/** Parts of the page that the guide needs. */
export interface GuidedPage {
  commands: MapCommands;
  /** The field of the token, and the results of commands. */
  showMap(): void;
}

/** The second half of the set-up: a bar over the normal page, until the map is complete. */
export class Guide {
  private readonly root = element('section', 'guide');
  private readonly progress = element('p', 'guide-progress');
  private readonly title = element('h2');
  private readonly todo = element('p', 'guide-todo');
  private readonly status = element('p', 'guide-status');
  private readonly served = element('ul', 'guide-served');
  private readonly back = button('Back', 'To the step before', () => this.goTo(this.at - 1));
  private readonly keep = button('Keep the origin', 'Leave it as it is', () => this.goTo(this.at + 1));
  private readonly go = button('', '', () => this.press());
  private readonly end = button('End the set-up', 'Close this bar', () => this.close());
  private lines: LogLine[] = [];
  private at: number;
  private hello: Hello | null = null;
  private bodies: BodyFrame[] = [];
  private tags = 0;
  private joinedAt = performance.now();
  private lastEvent: number | null = null;
  private needsToken = false;
  private servedWords = '';

  constructor(
    private readonly half: SecondHalf,
    private readonly page: GuidedPage,
  ) {
    this.at = Math.min(GUIDE_STEPS.length - 1, Math.max(0, Math.floor(half.at)));
    this.root.setAttribute('aria-label', 'Set-up, second half');
    this.status.setAttribute('role', 'status');
    this.go.classList.add('primary');
    const words = element('div', 'guide-words');
    words.append(this.title, this.todo, this.status, this.served);
    const buttons = element('div', 'guide-buttons');
    buttons.append(this.end, this.back, this.keep, this.go);
    this.root.append(this.progress, words, buttons);
    document.querySelector('main')?.before(this.root);
    document.body.classList.add('guided');
    this.show();
  }

  onHello(hello: Hello): void {
    this.hello = hello;
    // Frozen here or elsewhere: that step is done.
    if (this.step() === 'freeze' && hello.mapMode === 'frozen') return this.goTo(this.at + 1);
    this.show();
  }

  onTags(tags: number): void {
    if (tags > this.tags) this.joinedAt = performance.now();
    this.tags = tags;
    this.show();
  }

  onBodies(bodies: BodyFrame[]): void {
    this.bodies = bodies;
    this.goOnUnlocked();
    this.show();
  }

  onLog(lines: LogLine[]): void {
    const addresses = lines.filter((line) => servedBy([line], '').length > 0);
    this.lines = [...this.lines, ...addresses].slice(-MOST_LINES);
    this.show();
  }

  /** Aligned: that step is done. Events before this page was opened do not count. */
  onEvents(events: ServerEvent[]): void {
    const newest = events.reduce((most, event) => Math.max(most, event.n), this.lastEvent ?? 0);
    const before = this.lastEvent ?? newest;
    this.lastEvent = newest;
    const isAligned = events.some((event) => event.n > before && event.kind === 'aligned');
    if (isAligned && this.step() === 'align') this.goTo(this.at + 1);
  }

  private step(): GuideStep {
    return GUIDE_STEPS[this.at] ?? 'done';
  }

  private goTo(at: number): void {
    this.at = Math.min(GUIDE_STEPS.length - 1, Math.max(0, at));
    this.needsToken = false;
    remember({ file: this.half.file, at: this.at });
    this.show();
  }

  private press(): void {
    const step = this.step();
    if (step === 'move') return this.goTo(this.at + 1);
    if (step === 'done') return this.close();
    this.page.showMap();
    this.needsToken = !this.page.commands.isUnlocked;
    if (this.needsToken) this.page.commands.askForToken();
    else void (step === 'freeze' ? this.page.commands.freeze() : this.page.commands.align());
    this.show();
  }

  private close(): void {
    forget();
    this.root.remove();
    document.body.classList.remove('guided');
  }

  /** Continues with the command as soon as the token is there. */
  private goOnUnlocked(): void {
    if (this.needsToken && this.page.commands.isUnlocked) this.press();
  }

  private show(): void {
    const step = this.step();
    const { title, todo, primary } = GUIDE_WORDS[step];
    this.root.dataset.step = step;
    setText(this.progress, `${this.at + 1} of ${GUIDE_STEPS.length}`);
    setText(this.title, title);
    setText(this.todo, todo);
    setText(this.go, primary);
    const isReady = step !== 'move' || isMapped(this.tags, this.quietS(), this.bodies);
    this.go.dataset.ready = String(isReady);
    this.back.hidden = this.at === 0;
    this.keep.hidden = step !== 'align';
    this.end.hidden = step === 'done';
    setText(this.status, this.statusWords(step));
    this.showServed(step === 'done');
  }

  /** Since a tag joined the map. */
  private quietS(): number {
    return (performance.now() - this.joinedAt) / 1000;
  }

  private statusWords(step: GuideStep): string {
    if (step === 'move') {
      const nameOf = (id: number): string =>
        this.hello?.bodies.find((body) => body.id === id)?.name ?? `robot ${id}`;
      return movingWords(this.tags, this.quietS(), this.bodies, nameOf);
    }
    if (step === 'done' || !this.needsToken) return '';
    const file = tokenFile(this.half.file);
    return `Type the operator’s token into the field on this page. It is in ${file}.`;
  }

  private showServed(shown: boolean): void {
    this.served.hidden = !shown;
    if (!shown) return;
    const all = servedBy(this.lines, location.hostname);
    const words = all.map(({ protocol, words }) => `${protocol}: ${words}`);
    const none = 'The log of the server names the ports, and so does its configuration.';
    const items = words.length > 0 ? words : [none];
    if (items.join('\n') === this.servedWords) return;
    this.servedWords = items.join('\n');
    this.served.replaceChildren(...items.map((one) => element('li', '', one)));
  }
}
