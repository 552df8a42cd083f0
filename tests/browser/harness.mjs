// What the tests of the page in a real browser share. Arguments: SERVER WEB_FOLDER CHROMIUM [SCREENSHOT_FOLDER]
import { spawn } from 'node:child_process';
import { createRequire } from 'node:module';
import { join } from 'node:path';

const [serverProgram, webFolder, chromiumProgram, shotFolder] = process.argv.slice(2);
const { chromium } = createRequire(join(webFolder, 'package.json'))('playwright-core');
const PATIENCE_MS = 30_000; // the machine may be busy; nothing here waits longer than it must

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
  return { port, stop, tell };
}

/** A page that is live, and what went wrong in it. */
export async function openPage(browser, port, options) {
  const context = await browser.newContext(options);
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  const faults = [];
  page.on('console', (line) => line.type() === 'error' && faults.push(line.text()));
  page.on('pageerror', (error) => faults.push(String(error)));
  page.on('response', (response) => response.status() >= 400 && faults.push(`${response.status()} ${response.url()}`));
  await page.goto(`http://127.0.0.1:${port}/`);
  await page.waitForSelector('body[data-link=live]');
  return { page, faults };
}

const steps = [];
export const step = (name, run) => steps.push({ name, run });
export const world = {};

/** A picture for people, where they asked for some. */
export async function shoot(page, name) {
  if (shotFolder) await page.screenshot({ path: join(shotFolder, `${name}.png`) });
}

export async function runSteps() {
  world.browser = await chromium.launch({
    executablePath: chromiumProgram,
    args: ['--no-sandbox', '--enable-unsafe-swiftshader'],
    timeout: PATIENCE_MS,
  });
  try {
    for (const { name, run } of steps) {
      await run();
      console.log(`ok: ${name}`);
    }
  } catch (error) {
    if (world.page) await shoot(world.page, 'page-failed').catch(() => {});
    throw error;
  } finally {
    await world.browser.close();
    await world.server?.stop();
  }
}
