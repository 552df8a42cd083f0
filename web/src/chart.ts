import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { fixed } from './format';
import type { BodyFrame, BodyName } from './protocol';
import { bodyColour } from './theme';

export type ChartQuantity = 'sigma' | 'latency';

const SHOWN_S = 60;
// Five points a second: more than the pixels of a wall screen.
const STEP_MS = 200;
const CAPACITY = (SHOWN_S * 1000) / STEP_MS + 2;
const TEXT = '#9fb0bf';
const GRID = { stroke: '#1d2730', width: 1 };
const FONT = '12px system-ui, sans-serif';

/** The last minute of one quantity, one line per body. */
export class StripChart {
  private plot: uPlot | null = null;
  private bodies: BodyName[] = [];
  private quantity: ChartQuantity = 'sigma';
  private times: number[] = [];
  private series: Record<ChartQuantity, (number | null)[][]> = { sigma: [], latency: [] };

  constructor(private readonly host: HTMLElement) {
    new ResizeObserver(() => this.plot?.setSize(this.size())).observe(host);
  }

  setBodies(bodies: BodyName[]): void {
    this.bodies = bodies;
    this.times = [];
    this.series = { sigma: bodies.map(() => []), latency: bodies.map(() => []) };
    this.rebuild();
  }

  show(quantity: ChartQuantity): void {
    this.quantity = quantity;
    this.rebuild();
  }

  add(utcMs: number, frame: BodyFrame[]): void {
    const last = this.times[this.times.length - 1];
    const at = utcMs / 1000;
    if (last !== undefined && at < last) this.setBodies(this.bodies); // the server's clock started again
    else if (last !== undefined && at - last < STEP_MS / 1000) return;
    this.times.push(at);
    this.bodies.forEach((body, i) => {
      const now = frame.find((entry) => entry.id === body.id);
      this.series.sigma[i]?.push(now?.valid ? (now.pose?.sigmaMm ?? null) : null);
      this.series.latency[i]?.push(now?.latencyMs ?? null);
    });
    if (this.times.length > CAPACITY) {
      this.times.shift();
      for (const line of [...this.series.sigma, ...this.series.latency]) line.shift();
    }
    this.draw();
  }

  private draw(): void {
    const now = this.times[this.times.length - 1];
    if (now === undefined) return;
    const ago = this.times.map((time) => time - now);
    this.plot?.setData([ago, ...this.series[this.quantity]]);
  }

  private size(): { width: number; height: number } {
    return { width: Math.max(120, this.host.clientWidth), height: Math.max(60, this.host.clientHeight) };
  }

  private rebuild(): void {
    this.plot?.destroy();
    const axis = { stroke: TEXT, grid: GRID, ticks: GRID, font: FONT };
    this.plot = new uPlot(
      {
        ...this.size(),
        legend: { show: false },
        cursor: { show: false },
        padding: [8, 12, 0, 0],
        scales: {
          x: { time: false, range: [-SHOWN_S, 0] },
          // Logarithmic: millimetres while tracking and half a metre while coasting are both legible.
          y: { distr: this.quantity === 'sigma' ? 3 : 1, range: rangeOf(this.quantity) },
        },
        axes: [
          { ...axis, size: 26, gap: 3, values: (_, ticks) => ticks.map((s) => (s === 0 ? 'now' : `${fixed(s, 0)} s`)) },
          { ...axis, size: 46, gap: 4, space: 22, values: (_, ticks) => ticks.map(tickText) },
        ],
        series: [
          {},
          ...this.bodies.map((body, place) => ({
            label: body.name,
            stroke: bodyColour(place),
            width: 2,
            points: { show: false },
          })),
        ],
      },
      [[], ...this.bodies.map(() => [])] as uPlot.AlignedData,
      this.host,
    );
    this.draw();
  }
}

/** A log axis keeps only its round ticks; the others have no text. */
function tickText(tick: number | null): string {
  if (tick === null || tick === undefined) return '';
  return tick < 1 ? fixed(tick, 1) : fixed(tick, 0);
}

function rangeOf(quantity: ChartQuantity): (plot: uPlot, low: number | null, high: number | null) => [number, number] {
  if (quantity === 'sigma') {
    return (_, low, high) => [10 ** Math.floor(Math.log10(Math.max(low ?? 1, 0.1))), 10 ** Math.ceil(Math.log10((high ?? 10) + 1e-9))];
  }
  return (_, __, high) => [0, Math.max(10, (high ?? 10) * 1.2)];
}
