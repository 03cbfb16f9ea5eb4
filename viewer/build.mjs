// Bundles src/main.js with three.js into ../src/reports/assets/viewer.js, the one script every report carries, and copies the
// licence of three.js beside it. `--check` fails when the committed bundle is not what the sources give.
import { build } from 'esbuild';
import { readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const assets = join(here, '..', 'src', 'reports', 'assets');
const three = join(here, 'node_modules', 'three');
const version = JSON.parse(readFileSync(join(three, 'package.json'), 'utf8')).version;

const result = await build({
  entryPoints: [join(here, 'src', 'main.js')],
  bundle: true,
  minify: true,
  format: 'iife',
  target: 'es2020',
  charset: 'ascii',
  legalComments: 'none',
  write: false,
  banner: { js: `/* three.js ${version}, MIT licence, (c) three.js authors; bundled with the medial-scaffold viewer */` },
});
const text = result.outputFiles[0].text;
if (/<\/script/i.test(text)) throw new Error('the bundle would end its own script element');
const licence = readFileSync(join(three, 'LICENSE'), 'utf8');

const targets = [[join(assets, 'viewer.js'), text], [join(assets, 'THREE-LICENSE.txt'), licence]];
for (const [path, want] of targets) {
  if (process.argv.includes('--check')) {
    if (readFileSync(path, 'utf8') !== want) throw new Error(`${path} is out of date: npm run build`);
  } else {
    writeFileSync(path, want);
    console.log(`${path}: ${want.length} characters`);
  }
}
