// What the tests of the page in a real browser share. Arguments: SERVER WEB_FOLDER CHROMIUM [SCREENSHOT_FOLDER]
import { spawn } from 'node:child_process';
import { createRequire } from 'node:module';
import { join } from 'node:path';

const [serverProgram, webFolder, chromiumProgram, shotFolder] = process.argv.slice(2).filter((one) => !one.startsWith('--'));
const { chromium } = createRequire(join(webFolder, 'package.json'))('playwright-core');
const TIMEOUT_MS = 120_000; // the machine may be busy

/**
 * Runs in the page. A slow screen, since the processor draws the room here. A drawing is read in the same turn, while the
 * browser has it: `drawn` has their number, the colours, and a sum of all.
 */
export function watchDrawing(periodMs) {
  const look = () => {
    const stage = document.querySelector('.stage canvas');
    if (!stage) return;
    const context = new OffscreenCanvas(stage.width, stage.height).getContext('2d');
    context.drawImage(stage, 0, 0);
    const pixels = new Uint32Array(context.getImageData(0, 0, stage.width, stage.height).data.buffer);
    const colours = new Set(pixels);
    if (colours.size < 2) return; // another canvas was drawn in this turn
    window.drawn = { times: (window.drawn?.times ?? 0) + 1, colours, sum: pixels.reduce((sum, pixel) => (31 * sum + pixel) | 0, 0) };
  };
  window.requestAnimationFrame = (act) =>
    setTimeout(() => {
      act(performance.now());
      look();
    }, periodMs);
  window.cancelAnimationFrame = clearTimeout;
}

/** Runs in the page: sums how far its parts move without an input of the user. */
export function watchLayout() {
  window.shifted = 0;
  new PerformanceObserver((list) => {
    for (const { value, hadRecentInput, sources } of list.getEntries()) {
      if (hadRecentInput) continue;
      window.shifted += value;
      const names = sources.map(({ node }) => node?.className || node?.nodeName || '');
      console.log(`moved by ${value.toFixed(4)}: ${names.join(', ')}`);
    }
  }).observe({ type: 'layout-shift', buffered: true });
}

/** Red, green and blue in the order of a picture's words. */
export function pixel(hex) {
  const [r, g, b] = hex.match(/[0-9a-f]{2}/g).map((part) => Number.parseInt(part, 16));
  return (0xff000000 | (b << 16) | (g << 8) | r) >>> 0;
}

/** Does something, then waits until the room was drawn again. */
export async function nextDrawing(page, act) {
  const times = await page.evaluate(() => window.drawn?.times ?? 0);
  await act();
  await page.waitForFunction((old) => (window.drawn?.times ?? 0) > old, times);
}

export async function startServer(...options) {
  const child = spawn(serverProgram, options, { stdio: ['pipe', 'pipe', 'ignore'] });
  const port = await new Promise((resolve, reject) => {
    child.stdout.once('data', (text) => resolve(Number.parseInt(text, 10)));
    child.once('exit', (code) => reject(new Error(`the server ended with ${code}`)));
  });
  const stop = async () => {
    const ended = new Promise((resolve) => child.once('exit', resolve));
    child.stdin.end();
    const late = setTimeout(() => child.kill('SIGKILL'), 5000);
    await ended;
    clearTimeout(late);
  };
  const tell = (line) => child.stdin.write(`${line}\n`);
  /** The line that it prints. */
  const ask = (line) =>
    new Promise((resolve) => {
      child.stdout.once('data', (text) => resolve(String(text).trim()));
      tell(line);
    });
  return { port, stop, tell, ask };
}

/** A live page, and its errors. */
export async function openPage(browser, port, options) {
  const context = await browser.newContext(options);
  const page = await context.newPage();
  await page.addInitScript(watchDrawing, 300);
  await page.addInitScript(watchLayout);
  page.setDefaultTimeout(TIMEOUT_MS);
  const faults = [];
  page.on('console', (line) => line.type() === 'error' && faults.push(line.text()));
  page.on('console', (line) => line.text().startsWith('moved by') && console.log(line.text()));
  page.on('pageerror', (error) => faults.push(String(error)));
  page.on('response', (response) => {
    if (response.status() >= 400) faults.push(`${response.status()} ${response.url()}`);
  });
  await page.goto(`http://127.0.0.1:${port}/`);
  await page.waitForSelector('body[data-link=live]');
  return { page, faults };
}

const steps = [];
export const step = (name, run) => steps.push({ name, run });
export const world = {};

/** A picture on request; no test depends on it. @param room  wait for it */
export async function shoot(page, name, room = true) {
  if (!shotFolder) return;
  const picture = async () => {
    if (room) await page.waitForFunction(() => window.drawn);
    await page.screenshot({ path: join(shotFolder, `${name}.png`) });
  };
  await picture().catch((error) => console.log(`no picture ${name}: ${error.message}`));
}

export async function runSteps() {
  world.browser = await chromium.launch({
    executablePath: chromiumProgram,
    args: ['--no-sandbox', '--enable-unsafe-swiftshader'],
    timeout: TIMEOUT_MS,
  });
  try {
    for (const { name, run } of steps) {
      await run();
      console.log(`ok: ${name}`);
    }
  } catch (error) {
    if (world.page) await shoot(world.page, 'page-failed', false);
    throw error;
  } finally {
    await world.browser.close();
    await world.server?.stop();
  }
}

// --- actions of a person on the open page -----------------------------------------------------------------
export const button = (name) => world.page.getByRole('button', { name, exact: true });
export const press = (name) => button(name).click();
export const title = (words) => world.page.getByRole('heading', { name: words, exact: true }).waitFor();

export async function waitForText(selector, words) {
  await world.page.waitForFunction(
    ([at, pattern]) => new RegExp(pattern).test(document.querySelector(at)?.textContent ?? ''),
    [selector, words.source],
  );
}
