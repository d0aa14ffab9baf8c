// Types from the contract, type check, page: npm run build -- --outDir FOLDER
import {spawnSync} from 'node:child_process';
import {existsSync} from 'node:fs';
import {dirname, join, resolve} from 'node:path';
import {fileURLToPath} from 'node:url';
import {parseArgs} from 'node:util';

import {build} from 'vite';

import config from './vite.config.mjs';

const {values} = parseArgs({options: {outDir: {type: 'string', default: 'dist'}}});
const here = dirname(fileURLToPath(import.meta.url));
const outDir = resolve(process.env.INIT_CWD ?? process.cwd(), values.outDir);

function run(script, ...args) {
  const done = spawnSync(process.execPath, [join(here, 'node_modules', script), ...args],
    {cwd: here, stdio: ['ignore', 'ignore', 'inherit']});
  if (done.status !== 0) process.exit(1);
}

if (!existsSync(join(here, 'node_modules'))) {
  console.error('no node_modules: npm ci --ignore-scripts');
  process.exit(1);
}
run('openapi-typescript/bin/cli.js', '../openapi.yaml', '-o', 'src/generated/openapi.ts');
const checked = spawnSync(process.execPath, [join(here, 'node_modules/typescript/bin/tsc'), '--noEmit'],
  {cwd: here, stdio: 'inherit'});
if (checked.status !== 0) process.exit(1);
await build({...config, configFile: false, logLevel: 'warn', build: {...config.build, outDir}});
