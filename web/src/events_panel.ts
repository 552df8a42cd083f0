import { alarmsOf, type Alarm } from './alarms';
import { element, setText } from './dom';
import { dateAndTime, plural, timeOfDay } from './format';
import type { Events, ServerEvent, Severity } from './protocol';

const WORD: Record<Severity, string> = { error: 'Error', warning: 'Warning', info: 'Note' };

const BARS = 2;

/** Alarms as bars over the room, two of them until all are asked for, and events as a list. */
export class EventsPanel {
  private all: Alarm[] = [];
  private showsAll = false;

  constructor(
    private readonly banner: HTMLElement,
    private readonly alarms: HTMLElement,
    private readonly more: HTMLElement,
    private readonly history: HTMLElement,
    private readonly summary: HTMLElement,
  ) {
    more.addEventListener('click', () => {
      this.showsAll = !this.showsAll;
      this.showAlarms();
    });
  }

  update(events: Events): void {
    this.all = alarmsOf(events.standing);
    this.showAlarms();
    this.history.replaceChildren(...[...events.events].reverse().map(eventElement));
    setText(this.summary, this.all.length === 0 ? '' : plural(this.all.length, 'alarm', 'alarms'));
  }

  private showAlarms(): void {
    const hidden = this.all.length - BARS;
    this.alarms.replaceChildren(...this.all.slice(0, this.showsAll ? undefined : BARS).map(alarmElement));
    this.banner.hidden = this.all.length === 0;
    this.more.hidden = hidden <= 0;
    setText(this.more, this.showsAll ? 'Fewer' : plural(hidden, 'more alarm', 'more alarms'));
  }
}

/** `since 14:03:05`, with the date when that was another day. */
export function since(utcMs: number, nowMs: number): string {
  const sameDay = new Date(utcMs).toDateString() === new Date(nowMs).toDateString();
  return `since ${sameDay ? timeOfDay(utcMs) : dateAndTime(utcMs)}`;
}

function timeElement(utcMs: number, words: string): HTMLTimeElement {
  const time = element('time', '', words);
  time.dateTime = new Date(utcMs).toISOString();
  return time;
}

// Texts come from devices, files and clients: they are set as text, never as markup.
function alarmElement({ subjects, worst, utcMs }: Alarm): HTMLLIElement {
  const item = element('li', `alarm ${worst.severity}`);
  item.dataset.subject = worst.subject;
  item.dataset.kind = worst.kind;
  const what = element('span', 'what');
  what.append(element('strong', 'subject', subjects.join(', ')), element('span', 'text', worst.text));
  item.append(element('span', 'severity', WORD[worst.severity]), what, timeElement(utcMs, since(utcMs, Date.now())));
  if (worst.remedy !== '') item.append(element('span', 'remedy', worst.remedy));
  return item;
}

function eventElement(event: ServerEvent): HTMLLIElement {
  const item = element('li', `line ${event.over ? 'over' : event.severity}`);
  const text = event.remedy === '' ? event.text : `${event.text}. ${event.remedy}`;
  item.append(timeElement(event.utcMs, timeOfDay(event.utcMs)), element('span', 'from', event.subject), element('span', 'text', text));
  return item;
}
