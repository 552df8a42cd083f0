// An operator changes the map by the page: a real browser, a real map with its store, real sockets.
import assert from 'node:assert/strict';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { nextDrawing, openPage, runSteps, shoot, startServer, step, world } from './harness.mjs';

const TOKEN = 'correct horse battery';
const folder = mkdtempSync(join(tmpdir(), 'fiducap-page-'));
// Small: the room is drawn by the processor here.
const WIDE = { viewport: { width: 1040, height: 640 }, reducedMotion: 'reduce' };

const button = (page, name) => page.getByRole('button', { name, exact: true });
const outcome = (page) => page.textContent('#versions .outcome');
const rowOf = (page, tag) => page.locator(`#versions tr[data-tag="${tag}"]`);

async function showMap(page) {
  await page.click('[data-list=versions]');
  await page.waitForFunction(() => {
    const bodies = document.getElementById('bodies');
    return bodies.scrollHeight <= bodies.clientHeight; // none is cut off
  });
  await page.waitForFunction(() => document.querySelectorAll('#versions table.tags tbody tr[data-tag]').length > 20);
}

/** Waits for the server's confirmation. */
async function waitFor(page, tone, words) {
  await page.waitForSelector(`#versions .outcome[data-tone=${tone}]`);
  await page.waitForFunction((text) => new RegExp(text).test(document.querySelector('#versions .outcome').textContent), words.source);
}

/** A button that opens a dialog; its input; its button. */
async function deed(page, opens, yes, typed) {
  await button(page, opens).click();
  if (typed !== undefined) await page.fill('dialog :is(input, textarea)', typed);
  await button(page, yes).click();
}

/** Streamed place of a tag, m. */
async function standsAt(page, tag, place) {
  await page.waitForFunction(async ([id, wanted]) => {
    const { map } = await (await fetch('api/v1/state')).json();
    const found = map.tags.find((one) => one.id === id);
    return found && found.p.every((x, i) => Math.abs(x - wanted[i]) < 1e-3);
  }, [tag, place]);
}

async function drag(page, from, to) {
  const [a, b] = await Promise.all([from, to].map((one) => page.locator(one).boundingBox()));
  await page.mouse.move(a.x + a.width / 2, a.y + a.height / 2);
  await page.mouse.down();
  await page.mouse.move(b.x + b.width / 2, b.y + b.height / 2, { steps: 5 });
  await page.mouse.up();
}

async function chooseTag(page, tag) {
  const chosen = rowOf(page, tag).getByRole('button');
  if ((await chosen.getAttribute('aria-pressed')) !== 'true') await chosen.click();
}

step('a server without a token offers nothing and shows the reason', async () => {
  world.server = await startServer('--store', folder);
  const { page, faults } = await openPage(world.browser, world.server.port, WIDE);
  await showMap(page);
  assert.match(await page.textContent('#versions .why'), /takes no commands: set operator\.token/);
  assert.ok(await page.isHidden('#versions .token'));
  for (const name of ['Freeze', 'Commit…', 'Origin…']) assert.ok(await button(page, name).isDisabled(), name);
  await chooseTag(page, 9);
  for (const name of ['Quarantine…', 'Forget…']) assert.ok(await button(page, name).isDisabled(), name);
  assert.deepEqual(faults, []);
  await page.context().close();
  await world.server.stop();
});

step('without the token no button works, and the page shows it', async () => {
  world.server = await startServer('--store', folder, '--token', TOKEN);
  Object.assign(world, await openPage(world.browser, world.server.port, WIDE));
  const { page } = world;
  await showMap(page);
  assert.match(await page.textContent('#versions .why'), /Locked/);
  assert.ok(await button(page, 'Freeze').isDisabled());
  assert.match(await page.getAttribute('#versions .deeds', 'title'), /Locked/);
  await shoot(page, 'map-locked');
});

step('a wrong token opens nothing', async () => {
  const { page } = world;
  await page.fill('#versions .token input', 'wrong horse');
  await button(page, 'Unlock').click();
  await waitFor(page, 'bad', /Not unlocked: wrong operator token/);
  assert.ok(await button(page, 'Freeze').isDisabled());
});

step('the token opens, and is never sent', async () => {
  const { page } = world;
  const said = [];
  page.on('websocket', (socket) => socket.on('framesent', ({ payload }) => said.push(Buffer.from(payload).toString('latin1'))));
  await page.fill('#versions .token input', TOKEN);
  await page.press('#versions .token input', 'Enter');
  await page.waitForFunction(() => document.querySelector('#versions .why').textContent.startsWith('Unlocked'));
  assert.ok(said.length > 0);
  for (const message of said) assert.ok(!message.includes(TOKEN.slice(0, 7)));
  assert.ok(await button(page, 'Freeze').isEnabled());
  assert.ok(await page.isHidden('#versions .token'));
});

step('freezes the map and maps again', async () => {
  const { page } = world;
  await button(page, 'Freeze').click();
  await waitFor(page, 'good', /^The map is frozen\.$/);
  await button(page, 'Let it grow').waitFor();
  assert.match(await page.textContent('#map-line'), /frozen/);
});

step('refusals are shown with their reasons', async () => {
  const { page } = world;
  await chooseTag(page, 5);
  await deed(page, 'Forget…', 'Forget 5');
  await waitFor(page, 'bad', /^Refused: the map is frozen, nothing in it may move/);
  await shoot(page, 'map-refused');
  await button(page, 'Let it grow').click();
  await waitFor(page, 'good', /^The map grows again\.$/);
  await button(page, 'Freeze').waitFor();
});

step('stores the map under a name', async () => {
  const { page } = world;
  await deed(page, 'Commit…', 'Commit', 'before <the> fair');
  await waitFor(page, 'good', /^The map is stored as version 1\.$/);
  await page.waitForFunction(() => /^1.*24before <the> fair$/.test(document.querySelector('#versions tr[data-version="1"]')?.textContent ?? ''));
});

step('quarantines a tag after a confirmation', async () => {
  const { page } = world;
  await chooseTag(page, 9);
  await button(page, 'Quarantine…').click();
  await shoot(page, 'map-ask');
  await button(page, 'Cancel').click();
  assert.equal(await rowOf(page, 9).locator('td').first().textContent(), 'calibrated');
  await deed(page, 'Quarantine…', 'Quarantine 9');
  await waitFor(page, 'good', /^Tag 9 is not used any more, by an operator/);
  await page.waitForSelector('#versions tr[data-tag="9"] td.quarantined');
});

step('forgets a tag', async () => {
  const { page } = world;
  await chooseTag(page, 20);
  await deed(page, 'Forget…', 'Forget 20');
  await waitFor(page, 'good', /^Tag 20 was forgotten/);
  await rowOf(page, 20).waitFor({ state: 'detached' });
  await chooseTag(page, 0);
  await deed(page, 'Forget…', 'Forget 0');
  await waitFor(page, 'bad', /^Refused: tag 0 is the reference tag/);
});

step('aligns by measured tags, and refuses impossible ones', async () => {
  const { page } = world;
  await button(page, 'Origin…').click();
  await deed(page, 'I have measured places…', 'Align', '0 0 0 0\n1 2.4 zero 0');
  assert.match(await page.textContent('dialog .fault'), /“1 2\.4 zero 0” is not a tag's id/);
  await page.fill('dialog textarea', '0 0 0 0\n1 2.4 0 0\n4 0 9.9 0');
  await button(page, 'Align').click();
  await waitFor(page, 'bad', /^Refused: .*tag/);
  await button(page, 'Origin…').click();
  await deed(page, 'I have measured places…', 'Align', '0 10 5 0\n1 12.4 5 0\n4 10, 7.4, 0');
  await waitFor(page, 'good', /^The map is aligned to 3 measured tags, within 0 mm\.$/);
  await standsAt(page, 1, [12.4, 5, 0]);
});

step('moves the origin by three picked tags, by dragging and by numbers', async () => {
  const { page } = world;
  await button(page, 'Origin…').click();
  for (const [pick, tag] of [['origin', 0], ['heading', 4], ['floor', 1]]) {
    await page.waitForSelector(`dialog.origin[data-pick=${pick}]`);
    await page.click(`.plan [data-tag="${tag}"] .plan-reach`);
  }
  await shoot(page, 'origin-picked', false);
  await button(page, 'This is the origin').click();
  await waitFor(page, 'good', /^The map is aligned to \d+ measured tags, within 0 mm\.$/);
  await standsAt(page, 0, [0, 0, 0]);
  await standsAt(page, 4, [2.4, 0, 0]);
  await standsAt(page, 1, [0, -2.4, 0]);

  await button(page, 'Origin…').click();
  await drag(page, '.plan-origin', '.plan [data-tag="4"] .plan-reach');
  assert.ok(Math.abs((await page.inputValue('dialog [name=x]')) - 2.4) < 0.02);
  await page.fill('dialog [name=y]', '');
  await button(page, 'This is the origin').click();
  assert.match(await page.textContent('dialog .fault'), /“y, m” is no number/);
  await page.fill('dialog [name=y]', '0.0137'); // between two steps of the field
  await button(page, 'This is the origin').click();
  await waitFor(page, 'good', /^The map is aligned/);

  await button(page, 'Origin…').click();
  // Clicks pass through a handle.
  for (const [pick, tag] of [['origin', 0], ['heading', 4], ['floor', 0]]) {
    await page.waitForSelector(`dialog.origin[data-pick=${pick}]`);
    await page.locator(`.plan [data-tag="${tag}"] .plan-reach`).click({ force: true });
  }
  await button(page, 'This is the origin').click();
  await standsAt(page, 4, [2.4, 0, 0]);
  await button(page, 'Origin…').click();
  await page.fill('dialog [name=x]', '2.4');
  await page.fill('dialog [name=y]', '0');
  await page.fill('dialog [name=z]', '-0.5');
  await drag(page, '.plan-tip', '.plan [data-tag="0"] .plan-reach');
  assert.ok(Math.abs(Math.abs(await page.inputValue('dialog [name=turn]')) - 180) < 1);
  await page.fill('dialog [name=turn]', '180');
  await shoot(page, 'origin-dragged', false);
  await button(page, 'This is the origin').click();
  await standsAt(page, 4, [0, 0, 0.5]);
  await standsAt(page, 0, [2.4, 0, 0.5]);
});

step('names a version', async () => {
  const { page } = world;
  await deed(page, 'Commit…', 'Commit', '');
  await waitFor(page, 'good', /^The map is stored as version 2\.$/);
  await page.click('#versions tr[data-version="2"] button');
  await deed(page, 'Name…', 'Name it', 'without 20');
  await waitFor(page, 'good', /^Version 2 is called "without 20"\.$/);
  await page.waitForFunction(() => document.querySelector('#versions tr[data-version="2"] .name')?.textContent === 'without 20');
});

step('shows the changes in the room, and rolls back', async () => {
  const { page } = world;
  await page.click('#versions tr[data-version="1"] button');
  await page.waitForFunction(() => /Version 1 → 2: 1 tag differs/.test(document.querySelector('#versions .empty').textContent));
  assert.deepEqual(await page.$$eval('#versions table.changes tbody tr', (all) => all.map((row) => row.textContent)), ['20removed––']);
  await shoot(page, 'map-compared');
  await button(page, 'Roll back…').click();
  assert.match(await page.textContent('dialog'), /The 24 tags of version 1 are served again.*nothing is lost/);
  await button(page, 'Roll back to 1').click();
  await waitFor(page, 'good', /^The map was rolled back to version 1, stored as 3 with 24 tags\.$/);
  await rowOf(page, 20).waitFor();
  await page.waitForSelector('#versions tr[data-tag="9"] td.calibrated');
});

step('a tag is chosen by a click in the room', async () => {
  const { page } = world;
  await page.click('[data-list=log]');
  await nextDrawing(page, () => page.click('#view-top'));
  const canvas = await page.locator('.stage canvas').boundingBox();
  // Tags are around the middle of the floor: one of a row of points is on one.
  for (let i = 0; i < 60; ++i) {
    await page.mouse.click(canvas.x + canvas.width * (0.2 + 0.01 * i), canvas.y + canvas.height * (0.4 + 0.002 * (i % 5)));
    if (await page.isVisible('#versions')) break;
  }
  assert.ok(await page.isVisible('#versions'), 'no click met a tag');
  assert.equal(await page.locator('#versions tr[data-tag] button[aria-pressed=true]').count(), 1);
  await shoot(page, 'map-chosen');
});

step('the token is forgotten on request', async () => {
  const { page, faults } = world;
  await button(page, 'Lock').click();
  assert.ok(await button(page, 'Freeze').isDisabled());
  assert.match(await page.textContent('#versions .why'), /Locked/);
  // Versions that are being read from the disk are requested again, which browsers log.
  assert.deepEqual(faults.filter((fault) => !/^503 .*\/map\/diff\/|status of 503/.test(fault)), []);
});

step('letters typed into a field move no view', async () => {
  const { page } = world;
  await page.fill('#versions .token input', '');
  await page.type('#versions .token input', 'fret');
  assert.equal(await page.getAttribute('#view-follow', 'aria-pressed'), 'false');
});

step('a phone has room for all of it', async () => {
  const options = { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, reducedMotion: 'reduce' };
  const { page, faults } = await openPage(world.browser, world.server.port, options);
  await showMap(page);
  await chooseTag(page, 9);
  const [wide, screen] = await page.evaluate(() => [document.documentElement.scrollWidth, window.innerWidth]);
  assert.ok(wide <= screen, `${wide} px on a screen of ${screen} px`);
  await shoot(page, 'map-mobile');
  assert.deepEqual(faults, []);
  await page.context().close();
});

try {
  await runSteps();
} finally {
  rmSync(folder, { recursive: true, force: true });
}
