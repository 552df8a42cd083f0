// Pictures of cameras in a real browser: they are made while a page shows them, and outlines are in their places.
import assert from 'node:assert/strict';
import { openPage, runSteps, shoot, startServer, step, world } from './harness.mjs';

const WIDE = { viewport: { width: 1280, height: 800 }, reducedMotion: 'reduce' };
const tile = (page, body) => page.locator(`#cameras [data-camera="${body}/0"]`);
const made = async () => Number(await world.server.ask('pictures'));

/** Until no more are made; one may still be finished. */
async function waitForQuiet(page) {
  for (let before = await made(); ; ) {
    await page.waitForTimeout(1500);
    const now = await made();
    if (now === before) return;
    before = now;
  }
}

step('no pictures without a viewer', async () => {
  world.server = await startServer();
  Object.assign(world, await openPage(world.browser, world.server.port, WIDE));
  await world.page.waitForFunction(() => document.querySelectorAll('.card').length === 3);
  assert.equal(await made(), 0);
});

step('a tile for each camera shows its picture and its faults', async () => {
  const { page } = world;
  await page.click('[data-list=cameras]');
  for (const body of [1, 2, 3]) await tile(page, body).waitFor();
  await page.waitForFunction(() => [...document.querySelectorAll('#cameras .camera .facts')].every((facts) => /Hz/.test(facts.textContent)));
  assert.match(await tile(page, 1).textContent(), /anymal/);
  assert.match(await tile(page, 1).locator('.verdict').textContent(), /\w/);
  const colours = await tile(page, 1).locator('canvas').evaluate((canvas) => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return new Set(new Uint32Array(data.buffer)).size;
  });
  assert.ok(colours > 20, `${colours} colours are no picture`);
  await shoot(page, 'cameras-tiles');
});

step('one is shown large, with every kind of outline', async () => {
  const { page } = world;
  await tile(page, 2).click();
  await page.waitForSelector('.camera-view[open]');
  assert.match(await page.textContent('.camera-view h2'), /drone/);
  await page.waitForFunction(() => /Not a tag 1/.test(document.querySelector('[data-kind=candidate]').textContent));
  const counts = await page.$$eval('.kinds button', (all) => all.map((button) => button.textContent));
  assert.match(counts.join(', '), /Used \d+, Not used \d+, Not a tag 1, Expected \d+/);
  const found = counts.slice(0, 2).reduce((sum, text) => sum + Number(text.match(/\d+/)), 0);
  assert.equal(found, 2);
  assert.match(await page.textContent('.verdicts'), /Exposure is fine/);
  await shoot(page, 'cameras-large');
});

step('outlines lie on the tags', async () => {
  const { page } = world;
  // Inside of the outline is the black border, outside the white margin.
  await page.waitForFunction(() => document.querySelector('.view-stage canvas').getContext('2d'));
  const sides = await page.evaluate(() => {
    // In one turn: the drawing does not change meanwhile.
    for (const button of document.querySelectorAll('.kinds [aria-pressed=true]')) button.click();
    const canvas = document.querySelector('.view-stage canvas');
    const context = canvas.getContext('2d');
    const plain = context.getImageData(0, 0, canvas.width, canvas.height).data;
    for (const button of document.querySelectorAll('[data-kind=used], [data-kind=rejected]')) button.click();
    const drawn = context.getImageData(0, 0, canvas.width, canvas.height).data;
    // Drawn lines: is there an edge of the print below?
    let onEdge = 0;
    let all = 0;
    const gray = (x, y) => plain[4 * (y * canvas.width + x)];
    for (let y = 8; y + 8 < canvas.height; ++y) {
      for (let x = 8; x + 8 < canvas.width; ++x) {
        const i = 4 * (y * canvas.width + x);
        const isLine = (drawn[i] - drawn[i + 1]) ** 2 > 60 ** 2; // green or red, not gray
        if (!isLine) continue;
        all += 1;
        const around = [gray(x - 5, y), gray(x + 5, y), gray(x, y - 5), gray(x, y + 5)];
        if (Math.max(...around) - Math.min(...around) > 80) onEdge += 1;
      }
    }
    for (const button of document.querySelectorAll('.kinds [aria-pressed=false]')) button.click();
    return { onEdge, all };
  });
  assert.ok(sides.all > 300, `only ${sides.all} pixels of outlines`);
  assert.ok(sides.onEdge > 0.8 * sides.all, `${sides.onEdge} of ${sides.all} lie on an edge`);
});

step('pointer and arrow keys show the name of an outline', async () => {
  const { page } = world;
  const canvas = page.locator('.view-stage canvas');
  const box = await canvas.boundingBox();
  await page.mouse.click(box.x + (250 / 480) * box.width, box.y + (250 / 320) * box.height);
  assert.match(await page.textContent('.pointed'), /A square was not found: a dark square whose bits are no tag/);
  await canvas.focus();
  await page.keyboard.press('ArrowRight');
  const first = await page.textContent('.pointed');
  await page.keyboard.press('ArrowRight');
  assert.notEqual(await page.textContent('.pointed'), first);
  await shoot(page, 'cameras-pointed');
});

step('disabled outlines are not computed', async () => {
  const { page } = world;
  await page.click('[data-kind=candidate]');
  assert.equal(await page.getAttribute('[data-kind=candidate]', 'aria-pressed'), 'false');
  await page.waitForFunction(() => document.querySelector('[data-kind=candidate]').textContent === 'Not a tag 0');
});

step('closed and left, the server stops making pictures', async () => {
  const { page } = world;
  await page.keyboard.press('Escape');
  await page.waitForSelector('.camera-view', { state: 'hidden' });
  await page.click('[data-list=log]');
  await waitForQuiet(page);
  assert.ok((await made()) > 3);
  assert.deepEqual(world.faults, []);
});

step('an old picture is greyed and shows its age', async () => {
  const { page } = world;
  // The pictures of a closed panel are old until new ones arrive. The socket is blocked here.
  await page.evaluate(() => {
    window.WebSocket = class extends EventTarget {
      close() {}
      send() {}
    };
  });
  await page.click('[data-list=cameras]');
  await page.waitForFunction(() => document.querySelectorAll('#cameras .camera.stale').length === 3);
  assert.match(await tile(page, 1).locator('.facts').textContent(), /\d.* old/);
  await page.context().close();
});

step('fits a phone, and closes with its button', async () => {
  const options = { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, reducedMotion: 'reduce' };
  const { page, faults } = await openPage(world.browser, world.server.port, options);
  world.page = page;
  await page.click('[data-list=cameras]');
  await tile(page, 1).scrollIntoViewIfNeeded();
  await page.waitForFunction(() => /Hz/.test(document.querySelector('#cameras .camera .facts').textContent));
  await shoot(page, 'cameras-phone-tiles');
  await tile(page, 1).click();
  await page.waitForFunction(() => /px wide/.test(document.querySelector('.verdicts')?.textContent ?? ''));
  const [wide, screen] = await page.evaluate(() => {
    const dialog = document.querySelector('.camera-view');
    return [Math.max(document.documentElement.scrollWidth, dialog.scrollWidth), window.innerWidth];
  });
  assert.ok(wide <= screen, `${wide} px on a screen of ${screen} px`);
  await shoot(page, 'cameras-phone-large');
  await page.getByRole('button', { name: 'Close' }).click();
  await page.waitForSelector('.camera-view', { state: 'hidden' });
  assert.deepEqual(faults, []);
  await page.context().close();
  await world.server.stop();
});

step('switched off, it names the setting', async () => {
  world.server = await startServer('--cameras', 'off');
  Object.assign(world, await openPage(world.browser, world.server.port, WIDE));
  await world.page.click('[data-list=cameras]');
  await world.page.waitForFunction(() => /streaming\.web\.camera_views is `off`/.test(document.getElementById('cameras').textContent));
  assert.deepEqual(world.faults, []);
});

await runSteps();
