import { element, setText } from './dom';
import { count, duration, fixed, plural, UNKNOWN } from './format';
import type { Client } from './protocol';

const HEADINGS: [string, string][] = [
  ['Protocol', ''],
  ['Client', ''],
  ['Frames/s', 'number'],
  ['Dropped', 'number'],
  ['For', 'number'],
];

/** Who listens, by protocol, and what each lost. */
export class ClientsPanel {
  private before = new Map<string, { sent: number; at: number }>();
  private readonly rows: HTMLTableSectionElement;
  private readonly table: HTMLTableElement;
  private readonly nobody = element('p', 'empty', 'Nobody is connected.');

  constructor(
    host: HTMLElement,
    private readonly summary: HTMLElement,
  ) {
    this.table = element('table');
    const head = element('thead');
    const row = element('tr');
    for (const [name, className] of HEADINGS) {
      const cell = element('th', className, name);
      cell.scope = 'col';
      row.append(cell);
    }
    head.append(row);
    this.rows = element('tbody');
    this.table.append(head, this.rows);
    this.table.hidden = true;
    host.append(this.table, this.nobody);
  }

  /** @param now milliseconds of any steady clock, for the rates */
  update(clients: Client[], now: number): void {
    const sorted = [...clients].sort((a, b) => a.protocol.localeCompare(b.protocol) || a.peer.localeCompare(b.peer));
    const seen = new Map<string, { sent: number; at: number }>();
    this.rows.replaceChildren(
      ...sorted.map((client) => {
        const key = `${client.protocol} ${client.peer}`;
        seen.set(key, { sent: client.sent, at: now });
        return this.row(client, rate(this.before.get(key), client.sent, now));
      }),
    );
    this.before = seen;
    this.table.hidden = clients.length === 0;
    this.nobody.hidden = clients.length > 0;
    setText(this.summary, summaryOf(clients));
  }

  private row(client: Client, framesPerSecond: number | null): HTMLTableRowElement {
    const row = element('tr');
    const protocol = element('th', 'protocol', client.protocol);
    protocol.scope = 'row';
    const who = element('td', 'who');
    who.append(element('span', 'peer', client.peer), element('span', 'detail', client.detail));
    who.title = `${client.peer} – ${client.detail}`;
    const { value, unit } = duration(client.connectedS * 1e3);
    row.append(
      protocol,
      who,
      element('td', 'number', framesPerSecond === null ? UNKNOWN : fixed(framesPerSecond, 0)),
      element('td', client.dropped > 0 ? 'number dropped' : 'number', count(client.dropped)),
      element('td', 'number', `${value} ${unit}`),
    );
    return row;
  }
}

function rate(before: { sent: number; at: number } | undefined, sent: number, now: number): number | null {
  if (!before || now <= before.at || sent < before.sent) return null;
  return ((sent - before.sent) * 1e3) / (now - before.at);
}

/** `vrpn 2 · web 1 · 214 dropped` */
export function summaryOf(clients: Client[]): string {
  const perProtocol = new Map<string, number>();
  let dropped = 0;
  for (const client of clients) {
    perProtocol.set(client.protocol, (perProtocol.get(client.protocol) ?? 0) + 1);
    dropped += client.dropped;
  }
  const parts = [...perProtocol].sort().map(([protocol, number]) => `${protocol} ${number}`);
  if (clients.length > 0) parts.push(dropped === 0 ? 'nothing dropped' : plural(dropped, 'frame dropped', 'frames dropped'));
  return parts.join(' · ');
}
