import { element, setText } from './dom';
import { clockOffset, count, duration, fixed, plural, UNKNOWN } from './format';
import type { Client } from './protocol';

const HEADINGS: [string, string][] = [
  ['Protocol', ''],
  ['Client', ''],
  ['Frames/s', 'number'],
  ['Dropped', 'number'],
  ['Clock', 'number clock'],
  ['For', 'number'],
];

/** Connected clients, by protocol, with their dropped messages. */
export class ClientsPanel {
  private before = new Map<string, Client>();
  private readonly rows: HTMLTableSectionElement;
  private readonly table: HTMLTableElement;
  private readonly empty = element('p', 'empty', 'No client is connected.');

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
    host.append(this.table, this.empty);
  }

  update(clients: Client[]): void {
    const sorted = [...clients].sort((a, b) => a.protocol.localeCompare(b.protocol) || a.peer.localeCompare(b.peer));
    const seen = new Map<string, Client>();
    this.rows.replaceChildren(
      ...sorted.map((client) => {
        const key = `${client.protocol} ${client.peer}`;
        seen.set(key, client);
        return this.row(client, framesPerSecond(this.before.get(key), client));
      }),
    );
    this.before = seen;
    this.table.hidden = clients.length === 0;
    this.empty.hidden = clients.length > 0;
    setText(this.summary, summaryOf(clients));
  }

  private row(client: Client, rate: number | null): HTMLTableRowElement {
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
      element('td', 'number', rate === null ? UNKNOWN : fixed(rate, 0)),
      element('td', client.dropped > 0 ? 'number dropped' : 'number', count(client.dropped)),
      clockCell(client.clock),
      element('td', 'number', `${value} ${unit}`),
    );
    return row;
  }
}

/** By the server's own clock: messages bunch up on their way to a slow page. */
export function framesPerSecond(before: Client | undefined, client: Client): number | null {
  if (!before || client.connectedS <= before.connectedS || client.sent < before.sent) return null;
  return (client.sent - before.sent) / (client.connectedS - before.connectedS);
}

/** Offset above, its uncertainty below, like address and detail. */
function clockCell(clock: Client['clock']): HTMLTableCellElement {
  if (clock === null) {
    const cell = element('td', 'number clock', UNKNOWN);
    cell.title = 'not measured in this protocol, or not yet';
    return cell;
  }
  const offset = clockOffset(clock.offsetS);
  const doubt = clock.sigmaS < 1e-6 ? { value: '<1', unit: 'µs' } : clockOffset(clock.sigmaS);
  const cell = element('td', 'number clock');
  cell.append(element('span', '', `${offset.value} ${offset.unit}`), element('span', 'detail', `± ${doubt.value} ${doubt.unit}`));
  cell.title = `server's clock minus the client's: ${offset.value} ${offset.unit} ± ${doubt.value} ${doubt.unit}`;
  return cell;
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
