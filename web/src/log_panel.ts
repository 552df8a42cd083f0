import { element } from './dom';
import { timeOfDay } from './format';
import type { LogLine } from './protocol';

const KEPT_LINES = 300;

/** The newest lines of the server, newest at the bottom. Stays where the reader scrolled to. */
export class LogPanel {
  private newest = 0;

  constructor(private readonly host: HTMLElement) {
    // A line cut by the upper edge fades out; the first line of all does not.
    host.addEventListener('scroll', () => host.classList.toggle('scrolled', host.scrollTop > 2), { passive: true });
  }

  /** A new socket repeats everything, perhaps of a restarted server that counts from one. */
  restart(): void {
    this.newest = 0;
    this.host.replaceChildren();
  }

  add(lines: LogLine[]): void {
    const atEnd = this.host.scrollHeight - this.host.scrollTop - this.host.clientHeight < 24;
    const fresh = lines.filter((line) => line.n > this.newest);
    this.host.append(...fresh.map(lineElement));
    this.newest = fresh[fresh.length - 1]?.n ?? this.newest;
    while (this.host.childElementCount > KEPT_LINES) this.host.firstElementChild?.remove();
    if (atEnd) this.host.scrollTop = this.host.scrollHeight;
  }
}

function lineElement(line: LogLine): HTMLLIElement {
  const item = element('li', `line ${line.level}`);
  const time = element('time', '', timeOfDay(line.utcMs));
  time.dateTime = new Date(line.utcMs).toISOString();
  item.append(time, element('span', 'level', line.level), element('span', 'from', line.module), element('span', 'text', line.text));
  return item;
}
