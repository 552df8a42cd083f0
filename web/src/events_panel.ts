import { element, setText } from './dom';
import { dateAndTime, plural, timeOfDay } from './format';
import type { Events, ServerEvent, Severity } from './protocol';

const RANK: Record<Severity, number> = { error: 0, warning: 1, info: 2 };
const WORD: Record<Severity, string> = { error: 'Error', warning: 'Warning', info: 'Note' };

/** Present conditions as a banner, and events as a list. */
export class EventsPanel {
  constructor(
    private readonly banner: HTMLElement,
    private readonly alarms: HTMLElement,
    private readonly history: HTMLElement,
    private readonly summary: HTMLElement,
  ) {}

  update(events: Events): void {
    const alarms = bySeverity(events.standing);
    this.alarms.replaceChildren(...alarms.map(alarmElement));
    this.banner.hidden = alarms.length === 0;
    this.banner.dataset.severity = alarms[0]?.severity ?? '';
    this.history.replaceChildren(...[...events.events].reverse().map(eventElement));
    setText(this.summary, alarms.length === 0 ? '' : plural(alarms.length, 'alarm', 'alarms'));
  }
}

/** The most severe first, of equal ones the newest. Those of severity info are in the list only. */
export function bySeverity(standing: ServerEvent[]): ServerEvent[] {
  return standing.filter((event) => event.severity !== 'info').sort((a, b) => RANK[a.severity] - RANK[b.severity] || b.n - a.n);
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
function alarmElement(alarm: ServerEvent): HTMLLIElement {
  const item = element('li', `alarm ${alarm.severity}`);
  item.dataset.subject = alarm.subject;
  item.dataset.kind = alarm.kind;
  const what = element('span', 'what');
  what.append(element('strong', 'subject', alarm.subject), element('span', 'text', alarm.text));
  item.append(element('span', 'severity', WORD[alarm.severity]), what, timeElement(alarm.utcMs, since(alarm.utcMs, Date.now())));
  if (alarm.remedy !== '') item.append(element('span', 'remedy', alarm.remedy));
  return item;
}

function eventElement(event: ServerEvent): HTMLLIElement {
  const item = element('li', `line ${event.over ? 'over' : event.severity}`);
  const text = event.remedy === '' ? event.text : `${event.text}. ${event.remedy}`;
  item.append(timeElement(event.utcMs, timeOfDay(event.utcMs)), element('span', 'from', event.subject), element('span', 'text', text));
  return item;
}
