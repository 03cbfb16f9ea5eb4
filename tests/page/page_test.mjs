// Opens a report in headless Chromium, as a reader would: from a file, without network. Waits for the scene, checks its layers,
// turns layers, tolerance, colours and clip plane, picks a point, prints, and opens the page again without WebGL. Any console
// error, failed request or page error fails the test. Pictures go to the folder given second.
//
// node page_test.mjs REPORT.html [PICTURES]
import { chromium } from 'playwright-core';
import { existsSync, mkdirSync } from 'node:fs';
import { basename, join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';

const [report, pictures] = process.argv.slice(2);
if (!report || !existsSync(report)) {
  console.error('usage: node page_test.mjs REPORT.html [PICTURES]');
  process.exit(2);
}
if (pictures) mkdirSync(pictures, { recursive: true });
const browserPath = process.env.CHROMIUM
  ?? ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find(existsSync);
if (!browserPath) {
  console.error('no Chromium found; set CHROMIUM to its path');
  process.exit(2);
}
const problems = [];
const check = (ok, what) => {
  console.log(`${ok ? 'ok  ' : 'FAIL'} ${what}`);
  if (!ok) problems.push(what);
};
const name = basename(report, '.html');
const picture = (suffix) => (pictures ? join(pictures, `${name}${suffix}.png`) : undefined);

async function open(flags, use) {
  const browser = await chromium.launch({ executablePath: browserPath, headless: true, args: ['--no-sandbox', ...flags] });
  try {
    const page = await browser.newPage({ viewport: { width: 1400, height: 1000 } });
    page.setDefaultTimeout(120000);
    page.on('console', (m) => { if (m.type() === 'error') check(false, `console error: ${m.text()}`); });
    page.on('pageerror', (e) => check(false, `page error: ${e.message}`));
    page.on('request', (r) => {
      if (!/^(file|data|blob):/.test(r.url())) check(false, `the page asked the network for ${r.url()}`);
    });
    await page.goto(pathToFileURL(resolve(report)).href);
    await use(page);
  } finally {
    await browser.close();
  }
}

await open(['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'], async (page) => {
  const hasScene = await page.evaluate(() => Boolean(document.getElementById('scene-glb')));
  const result = await page.evaluate(() => JSON.parse(document.getElementById('result').textContent));
  check(result && typeof result === 'object', 'the result is in the page as JSON');
  if (!hasScene) {
    console.log('     the page has no scene');
    return;
  }
  await page.waitForFunction(() => document.getElementById('viewer').dataset.state !== 'loading', null, { timeout: 60000 });
  check(await page.evaluate(() => document.getElementById('viewer').dataset.state) === 'live', 'the scene is drawn by WebGL');
  const layers = await page.evaluate(() => window.medialViewer.layers.map((l) => ({ label: l.label, kind: l.kind, shown: l.object.visible })));
  check(layers.length > 0, `${layers.length} layers`);
  if (Array.isArray(result.sheets)) {
    const sheets = layers.filter((l) => l.kind === 'sheet').length;
    check(sheets === result.sheets.length, `${sheets} sheets in the scene, ${result.sheets.length} in the result`);
    check(layers.some((l) => l.kind === 'surface'), 'the surface is there');
  }
  if (Array.isArray(result.lesions) && result.lesions.length > 0) {
    // Both dates are there and coloured by growth in millimetres; before, both and after are three pictures.
    for (const shape of ['baseline', 'followup']) {
      const of = await page.evaluate((s) => window.medialViewer.layers.filter((l) => l.shape === s).map((l) => l.quantity?.unit ?? ''), shape);
      check(of.length >= result.lesions.length && of.slice(0, result.lesions.length).every((u) => u === 'mm'), `${shape}: ${of.length} surfaces, growth in mm`);
    }
    check(await page.locator('#stage .bar').count() === 1, 'one colour bar for the growth');
  }
  if (pictures) await page.screenshot({ path: picture(''), fullPage: true });
  const stage = page.locator('#stage');
  const pixels = () => page.evaluate(() => {
    const v = window.medialViewer;
    v.render();
    const gl = v.renderer.getContext();
    const { width, height } = v.renderer.domElement;
    const p = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, p);
    let drawn = 0;
    let hash = 0;
    for (let i = 0; i < p.length; i += 4) {
      if (Math.abs(p[i] - 246) + Math.abs(p[i + 1] - 248) + Math.abs(p[i + 2] - 250) > 24) drawn += 1;
      hash = (hash * 31 + p[i] + 7 * p[i + 1] + 13 * p[i + 2]) | 0;
    }
    return { share: drawn / (width * height), hash };
  });
  const first = await pixels();
  check(first.share > 0.05, `the picture is not empty (${(100 * first.share).toFixed(0)} % drawn)`);

  const dates = page.locator('#panel button[data-key="both"]');
  if (await dates.count()) {
    const seen = [];
    for (const key of ['followup', 'both', 'baseline']) {
      await page.locator(`#panel button[data-key="${key}"]`).evaluate((e) => e.click());
      seen.push((await pixels()).hash);
      if (pictures) await stage.screenshot({ path: picture(`-${key}`) });
    }
    check(new Set(seen).size === 3, 'before, both and after differ');
  }

  // Every layer switch changes what is shown.
  for (const input of await page.locator('#panel input[data-layer]').all()) {
    const key = await input.getAttribute('data-layer');
    const [kind, shape] = key.split('|');
    const visible = () => page.evaluate(([k, s]) => window.medialViewer.layers.filter((l) => l.kind === k && l.shape === s && l.object.visible).length, [kind, shape]);
    const before = await visible();
    // Clicked from inside the page: a software renderer under load is too slow for a pointer that waits for stillness.
    const click = () => input.evaluate((e) => e.click());
    await click();
    const off = await visible();
    await click();
    check(off !== before || before === 0, `switch ${key}: ${before} -> ${off}`);
    check(await visible() === before, `switch ${key} back`);
  }

  // No cell of a table is left without a value that means something.
  const cells = await page.evaluate(() => [...document.querySelectorAll('section.card td')].map((e) => e.textContent.trim()));
  check(cells.length > 10 && !cells.some((c) => /NaN|undefined|Infinity/.test(c)), `${cells.length} cells of tables, none of them NaN`);

  // A point of the picture belongs to a layer; what it says is in the layer.
  const picked = await page.evaluate(() => {
    const v = window.medialViewer;
    for (let k = 0; k < 400; k += 1) {
      const hit = v.pick(0.5 + 0.4 * Math.sin(k) * (k / 400), 0.5 + 0.4 * Math.cos(1.7 * k) * (k / 400));
      if (hit && (hit.kind !== 'surface' || k > 300 || !v.layers.some((l) => l.kind === 'sheet'))) return hit;
    }
    return null;
  });
  check(picked !== null && picked.position.every(Number.isFinite), `picked ${picked?.name}`);
  if (picked?.kind === 'sheet') {
    check(Number.isFinite(picked.properties.persistence_mm), `its persistence is ${picked.properties.persistence_mm} mm`);
  }
  const box = await stage.boundingBox();
  await page.mouse.click(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
  if (await page.evaluate(() => window.medialViewer.picked !== null)) {
    check(await page.locator('.picked').isVisible(), 'what was picked is named on the picture');
  }
  check((await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth)) <= 0, 'nothing runs out of the page sideways');

  if (layers.filter((l) => l.kind === 'sheet').length > 1) {
    const counts = await page.evaluate(() => {
      const v = window.medialViewer;
      const count = () => v.layers.filter((l) => l.kind === 'sheet' && l.object.visible).length;
      const at = (t) => { v.tolerance = t; v.apply(); return count(); };
      // Sheets that are switched off (the source's, at first) are no matter of the tolerance.
      at(0);
      const shown = v.layers.filter((l) => l.kind === 'sheet' && l.object.visible);
      const p = shown.map((l) => l.persistence).sort((a, b) => a - b);
      const out = [at(p[0]), at(p[p.length - 1]), p.length];
      at(v.settings.tolerance_mm ?? 0);
      return out;
    });
    check(counts[0] === counts[2] && counts[1] >= 1 && counts[1] <= counts[0], `tolerance hides sheets: ${counts}`);
  }
  for (const label of ['Sheets by', 'Surface by']) {
    const select = page.locator(`#panel select[aria-label="${label}"]`);
    if (await select.count()) {
      const values = await select.locator('option').evaluateAll((o) => o.map((e) => e.value));
      for (const v of values) {
        await select.selectOption(v);
        if (v === 'radius' || (label === 'Surface by' && v)) {
          check(await page.locator('#stage .bar').count() > 0, `${label} ${v}: a colour bar is shown`);
          if (pictures) await stage.screenshot({ path: picture(`-${v}`) });
        }
      }
      await select.selectOption(values[0]);
    }
  }
  await page.locator('#panel select[aria-label="Axis"]').selectOption('x');
  const clipped = await pixels();
  check(clipped.hash !== first.hash, 'the clip plane cuts');
  if (pictures) await stage.screenshot({ path: picture('-clip') });
  await page.locator('#panel select[aria-label="Axis"]').selectOption('off');
  const motion = page.locator('#panel button[data-key="given"]');
  if (await motion.count()) {
    await motion.evaluate((e) => e.click());
    check((await pixels()).share > 0.001, 'the source as given is drawn');
    if (pictures) await stage.screenshot({ path: picture('-given') });
    await page.locator('#panel button[data-key="aligned"]').evaluate((e) => e.click());
  }
  await page.emulateMedia({ media: 'print' });
  check(await page.locator('#still img').isVisible(), 'print shows the still picture');
  check(!(await stage.isVisible()), 'print hides the viewer');
  if (Array.isArray(result.lesions) && result.lesions.length > 0) {
    check(await page.locator('#still .bar').isVisible(), 'the printed picture has its colour bar');
  }
  if (pictures) await page.screenshot({ path: picture('-print'), fullPage: true });
});

// Without WebGL the still picture stands in, without any error.
await open(['--disable-gpu', '--disable-3d-apis'], async (page) => {
  if (!(await page.evaluate(() => Boolean(document.getElementById('scene-glb'))))) return;
  await page.waitForFunction(() => document.getElementById('viewer').dataset.state !== 'loading', null, { timeout: 30000 });
  check(await page.evaluate(() => document.getElementById('viewer').dataset.state) === 'still', 'without WebGL the still stands in');
  const size = await page.evaluate(() => { const i = document.querySelector('#still img'); return [i.naturalWidth, i.naturalHeight]; });
  check(size[0] > 400 && size[1] > 300, `the still is ${size.join(' x ')} pixels`);
});

console.log(problems.length ? `${problems.length} problems in ${report}` : `${report}: all well`);
process.exit(problems.length ? 1 : 0);
